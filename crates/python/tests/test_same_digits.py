"""The package and the program give the same digits."""

import subprocess

import numpy as np
import pytest

import hysteron


@pytest.fixture(scope="module")
def folder(tmp_path_factory, program):
    folder = tmp_path_factory.mktemp("digits")
    program(folder, "example", "paper-stage", "-o", "stage", "--json")
    program(folder, "fit", "stage", "--model", "mpi", "-o", "model.toml", "--json")
    return folder


def test_val_an_example_is_what_the_program_writes(folder, stage):
    assert hysteron.read(folder / "stage") == stage


def test_val_a_fit_writes_the_same_file(folder, model, tmp_path):
    model.save(tmp_path / "model.toml")
    assert (tmp_path / "model.toml").read_bytes() == (folder / "model.toml").read_bytes()
    assert hysteron.Model.load(folder / "model.toml") == model


def test_val_a_comparison_is_what_json_prints(folder, program, stage, model):
    assert hysteron.compare(stage, model).to_dict() == program(folder, "compare", "stage", "model.toml", "--json")


def test_val_residuals_are_those_of_predict(folder, program, stage, model):
    program(folder, "predict", "model.toml", "stage", "-o", "out.npz", "--json")
    with np.load(folder / "out.npz") as table:
        assert np.array_equal(np.concatenate(model.residual(stage)), table["residual_um"])


def test_val_diagnose_and_learn_are_what_json_prints(folder, program):
    fs = 5e3
    time = np.arange(600) / fs
    data = hysteron.simulate("paper-delay", 13 - 13 * np.cos(2 * np.pi * 20 * time), fs)
    for seed, (hz, half_v, role) in enumerate([(50, 10, "identify"), (100, 6, "identify"), (45, 9, "validate")], 2):
        u = 13 - half_v * np.cos(2 * np.pi * hz * time)
        data.append(u, hysteron.simulate("paper-delay", u, fs, seed=seed)[0].y, fs, role=role)
    data.save(folder / "small")
    learned = hysteron.learn(data, plays=4)
    said = program(folder, "learn", "small", "--plays", "4", "-o", "small.toml", "--json")
    assert learned.to_dict() == {name: said[name] for name in learned.to_dict()}
    assert learned.model.to_toml() == (folder / "small.toml").read_text(encoding="utf-8")
    model = hysteron.fit(data, "mpi", plays=4)
    model.save(folder / "plain.toml")
    diagnosis = hysteron.diagnose(data, model)
    assert diagnosis.to_dict() == program(folder, "diagnose", "small", "plain.toml", "--json")
    assert f"verdict: {diagnosis.verdict}" in repr(diagnosis) and "<svg" in diagnosis.page().text
    assert repr(learned).startswith("mpi fitted") and learned.ladder.steps


def test_val_errors_have_the_words_of_the_program(folder, program):
    said = subprocess.run(
        [program.path, "fit", "stage", "--model", "mpi", "--plays", "99"], cwd=folder, capture_output=True, text=True
    )
    assert said.returncode == 2
    with pytest.raises(hysteron.Error) as refused:
        hysteron.fit(hysteron.read(folder / "stage"), "mpi", plays=99)
    assert str(refused.value) in " ".join(said.stderr.replace("│", " ").split())
