"""Fleets: one result a dataset, each made once, corrupt ones as rows, the same table from every engine."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import hysteron
from hysteron import fleet

OPTIONS = {"model": "mpi", "plays": 4}


def small_stage(folder: Path, seed: int) -> Path:
    """A dataset that is diagnosed in a second or two."""
    fs, n = 5e3, 600
    t = np.arange(n) / fs
    data = hysteron.simulate("paper-rate", 13 - 13 * np.cos(2 * np.pi * 20 * t), fs, seed=seed)
    u = 13 - 9 * np.cos(2 * np.pi * 45 * t)
    judge = hysteron.simulate("paper-rate", u, fs, seed=seed + 100)
    data.append(u, judge[0].y, fs, role="validate", name="judge")
    data.save(folder / f"stage-{seed}")
    return folder / f"stage-{seed}"


@pytest.fixture(scope="module")
def stages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stages")
    paths = [small_stage(folder, seed) for seed in range(1, 4)]
    broken = folder / "broken"
    broken.mkdir()
    (broken / "dataset.toml").write_text("format = 1\nname = 3\n")
    return [*paths, broken, folder / "absent"]


def rows(table: Path):
    if table.suffix == ".csv":
        with open(table, newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))
    from pyarrow import parquet

    return parquet.read_table(table).to_pylist()


@pytest.fixture(scope="module")
def local(stages, tmp_path_factory):
    out = tmp_path_factory.mktemp("local")
    return out, rows(fleet.run(stages, out=out, work="diagnose", workers=2, **OPTIONS))


def test_val_every_dataset_is_a_row_and_a_corrupt_one_says_why(stages, local):
    out, table = local
    assert [row["path"] for row in table] == [str(path) for path in stages]
    assert all(row["verdict"] and row["error"] is None and row["last_percent"] > 0 for row in table[:3])
    assert "dataset.toml" in table[3]["error"] and "cannot open it" in table[4]["error"]
    model = hysteron.Model.from_toml(fleet.result(stages[0], out, "diagnose", **OPTIONS)["model"])
    assert model == hysteron.fit(hysteron.read(stages[0]), **OPTIONS)


def test_val_what_is_present_is_not_done_again(stages, local):
    out, table = local
    files = {file: file.stat().st_mtime_ns for file in (out / "results").iterdir()}
    assert len(files) == 5 and all(file.suffix == ".json" for file in files)
    began = time.monotonic()
    again = rows(fleet.run(stages, out=out, work="diagnose", workers=2, **OPTIONS))
    assert again == table and time.monotonic() - began < 2
    assert {file: file.stat().st_mtime_ns for file in (out / "results").iterdir()} == files


def test_val_content_and_options_make_the_key(stages, tmp_path):
    same = fleet.key(stages[0], "learn", OPTIONS)
    assert fleet.key(str(stages[0]), "learn", dict(OPTIONS)) == same
    assert fleet.key(stages[0], "learn", OPTIONS | {"plays": 5}) != same
    assert fleet.key(stages[0], "diagnose", OPTIONS) != same
    assert fleet.key(stages[1], "learn", OPTIONS) != same


def test_val_without_pyarrow_the_table_is_csv(stages, local, monkeypatch):
    out, table = local
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    path = fleet.run(stages[:1], out=out, work="diagnose", **OPTIONS)
    assert path.suffix == ".csv"
    assert rows(path)[0]["verdict"] == table[0]["verdict"]


def test_refuse_engines_and_work_that_are_not_there(stages, tmp_path):
    with pytest.raises(hysteron.Error, match="engine 'slurm': there are 'local', 'ray', 'dask'"):
        fleet.run(stages, out=tmp_path, engine="slurm")
    with pytest.raises(hysteron.Error, match="work 'fit': there are 'learn' and 'diagnose'"):
        fleet.run(stages, out=tmp_path, work="fit")


DRIVER = """
import sys
from hysteron import fleet
if __name__ == "__main__":
    out, engine, *paths = sys.argv[1:]
    print(fleet.run(paths, out=out, engine=engine, work="diagnose", workers=2, model="mpi", plays=4))
"""


@pytest.mark.cluster
@pytest.mark.parametrize("engine", ["ray", "dask"])
def test_val_a_cluster_whose_driver_is_killed_ends_at_the_same_table(engine, local, stages, tmp_path):
    _, table = local
    script = tmp_path / "driver.py"
    script.write_text(DRIVER)
    command = [sys.executable, str(script), str(tmp_path / "out"), engine, *map(str, stages)]
    results = tmp_path / "out/results"
    driver = subprocess.Popen(command, start_new_session=True)
    deadline = time.monotonic() + 120
    while not (results.exists() and list(results.glob("[!.]*.json"))):
        assert driver.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    # The driver and the workers that it started.
    os.killpg(driver.pid, signal.SIGKILL)
    driver.wait()
    before = {file: file.stat().st_mtime_ns for file in results.glob("[!.]*.json")}
    print(f"{engine}: {len(before)} of {len(stages)} results when the driver was killed")
    done = subprocess.run(command, capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stderr
    assert all(file.stat().st_mtime_ns == stamp for file, stamp in before.items())
    assert rows(Path(done.stdout.split()[-1])) == table
