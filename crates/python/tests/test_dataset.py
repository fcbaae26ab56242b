"""Datasets: arrays in, views out, the native format between them."""

import math
import pickle

import numpy as np
import pytest

import hysteron

FS = 12e3
N = 600


def wave(hz=40.0):
    u = 13 - 13 * np.cos(2 * math.pi * hz * np.arange(N) / FS)
    return u, 0.1 * u + 0.002 * u**2


def test_val_arrays_come_back_as_views_that_cannot_be_written():
    u, y = wave()
    data = hysteron.Dataset.from_arrays(u, y, FS, name="rig 3")
    record = data[0]
    assert (data.name, len(data), record.name, record.role, record.fs) == ("rig 3", 1, "record-1.csv", "identify", FS)
    assert np.array_equal(record.u, u) and np.array_equal(record.y, y)
    assert record.time[3] == 3 / FS
    assert np.shares_memory(record.u, record.u)
    with pytest.raises(ValueError):
        record.u[0] = 1.0


def test_val_a_view_outlives_its_dataset_and_appends_leave_it_alone():
    u, y = wave()
    data = hysteron.Dataset.from_arrays(u, y, FS)
    view = data[0].u
    data.append(2 * u, y, FS, role="validate")
    del data
    assert np.array_equal(view, u)


def test_val_several_records_at_once_with_roles_and_columns():
    u, y = wave()
    heat = np.full(N, 21.5)
    data = hysteron.Dataset.from_arrays(
        [u, 2 * u], [y, 2 * y], [FS, 2 * FS], role=["identify", "validate"], temperature=[heat, heat + 1]
    )
    assert [r.role for r in data] == ["identify", "validate"]
    assert [r.fs for r in data] == [FS, 2 * FS]
    assert data[1].temperature[0] == 22.5 and data[0].voltage2 is None
    both = hysteron.Dataset.from_arrays(np.stack([u, u]), np.stack([y, y]), FS)
    assert len(both) == 2
    assert data[-1].name == "record-2.csv"
    with pytest.raises(IndexError):
        data[2]


def test_val_lists_integers_and_single_precision_are_numbers():
    data = hysteron.Dataset.from_arrays([0, 1, 2, 3], np.arange(4, dtype=np.float32), 10)
    assert data[0].u.dtype == np.float64 and data[0].y[3] == 3.0


def test_val_what_is_saved_is_read_to_the_last_bit(tmp_path):
    u, y = wave()
    data = hysteron.Dataset.from_arrays(u, y / 3, FS)
    data.append(u / 7, y, FS, role="validate", name="judge")
    data.save(tmp_path / "stage")
    again = hysteron.read(tmp_path / "stage")
    assert [r.name for r in again] == ["record-1.csv", "judge.csv"]
    assert all(np.array_equal(a.u, b.u) and np.array_equal(a.y, b.y) for a, b in zip(data, again))
    with pytest.raises(hysteron.Error, match="already exists and is not overwritten"):
        data.save(tmp_path / "stage")
    data.save(tmp_path / "stage", overwrite=True)


def test_val_any_recording_is_imported(tmp_path):
    scope = tmp_path / "scope.csv"
    scope.write_text("Rig 3\nZeit [ms];Spannung [V];Weg [nm]\n0,0;1,5;250\n0,2;2,5;500\n", encoding="utf-8")
    with pytest.warns(UserWarning, match="converted from nm"):
        record = hysteron.read(scope, role="validate")[0]
    assert (record.fs, record.role, list(record.y)) == (5000.0, "validate", [0.25, 0.5])
    np.savez(tmp_path / "run.npz", drive=[0.0, 1.0, 2.0], sensor=[0.0, 10.0, 20.0])
    columns = {"voltage": "drive:V*20", "position": "sensor:nm"}
    with pytest.warns(UserWarning, match="converted from nm"):
        record = hysteron.read(tmp_path / "run.npz", columns=columns, fs=1000)[0]
    assert list(record.u) == [0.0, 20.0, 40.0] and record.y[2] == pytest.approx(0.02)


def test_val_a_table_gives_its_clock():
    pandas = pytest.importorskip("pandas")
    u, y = wave()
    table = pandas.DataFrame({"time_s": np.arange(N) / FS, "voltage_v": u, "position_um": y, "gap": y})
    assert hysteron.Dataset.from_dataframe(table)[0].fs == FS
    assert hysteron.Dataset.from_dataframe(table, y="gap", fs=10)[0].fs == 10
    table.loc[5, "time_s"] += 0.5 / FS
    with pytest.raises(hysteron.Error, match=r"time_s\[5\]: time .* after the stamp before it"):
        hysteron.Dataset.from_dataframe(table)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"u": [1.0, 2.0]}, "position_um has 600 samples, voltage_v has 2; all columns have the same length"),
        ({"y": np.full(N, np.nan)}, r"position_um\[0\] = NaN; values are finite"),
        ({"fs": 0.0}, "fs = 0: a sample rate is a finite number of hertz above 0"),
        ({"fs": float("nan")}, "fs = NaN: a sample rate"),
        ({"role": "judge"}, "role: unknown variant `judge`, expected `identify` or `validate`"),
        ({"u": "volts"}, "u: one number a sample is wanted"),
        ({"u": [1.0], "y": [1.0]}, "1 sample"),
    ],
)
def test_refuse_arrays_that_are_no_record(change, words):
    u, y = wave()
    given = {"u": u, "y": y, "fs": FS} | change
    with pytest.raises(hysteron.Error, match=words):
        hysteron.Dataset.from_arrays(**given)


def test_refuse_names_and_files_that_are_taken_or_absent(tmp_path):
    u, y = wave()
    data = hysteron.Dataset.from_arrays(u, y, FS)
    with pytest.raises(hysteron.Error, match="there is a record of this name already"):
        data.append(u, y, FS, name="record-1")
    with pytest.raises(ValueError, match="cannot open it"):
        hysteron.read(tmp_path / "absent")
    with pytest.raises(hysteron.Error, match="no quantity of a record"):
        hysteron.read(tmp_path / "absent.csv", columns={"volts": "1"})
    with pytest.raises(hysteron.Error, match="there is no example `creep`; there are paper-stage"):
        hysteron.example("creep")
    with pytest.raises(hysteron.Error, match="there is no stage `9k`"):
        hysteron.simulate("9k")


def test_val_a_simulated_stage_answers_a_voltage():
    u, _ = wave()
    once, again, other = (hysteron.simulate("paper-rate", u, 50e3, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(once[0].y, again[0].y) and not np.array_equal(once[0].y, other[0].y)
    assert np.ptp(once[0].y) == pytest.approx(2.6, rel=0.05)


def test_val_objects_print_well(stage):
    assert repr(stage).startswith('Dataset "paper-stage", 9 records\n  sine-011hz.csv: identify, ')
    assert "<td>noise-300hz.csv</td><td>validate</td>" in stage._repr_html_()


def test_val_models_are_pickled_as_their_file(model):
    assert pickle.loads(pickle.dumps(model)) == model
