"""Fleets: one result a dataset, each made once, corrupt ones as rows, the same table from every engine."""

import contextlib
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
    with pytest.raises(hysteron.Error, match="work 'mend': there are 'learn', 'diagnose' and 'fit'"):
        fleet.run(stages, out=tmp_path, work="mend")


def test_val_a_fit_alone_is_a_row_with_its_error(stages, local, tmp_path):
    _, table = local
    [row] = rows(fleet.run(stages[:1], out=tmp_path, work="fit", workers=1, **OPTIONS))
    assert row["verdict"] is None and row["error"] is None
    assert row["last_percent"] == row["first_percent"] == pytest.approx(table[0]["last_percent"])
    assert "compared" in fleet.result(stages[0], tmp_path, "fit", **OPTIONS)


# Datasets of the clusters' test, and how many results there are when a worker, then the driver is killed.
MANY, WORKER_DIES, DRIVER_DIES = 1000, 150, 450

DRIVER = """
import sys
from pathlib import Path
from hysteron import fleet
if __name__ == "__main__":
    folder, out, engine = sys.argv[1:]
    paths = sorted(Path(folder).iterdir()) + [Path(folder) / "absent"]
    print(fleet.run(paths, out=out, engine=engine, work="fit", workers=2, model="mpi", plays=2))
"""


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """A thousand small datasets: 998 recordings, a corrupt one, an absent one; and the table of this machine's processes."""
    folder = tmp_path_factory.mktemp("many")
    fs = 5e3
    t = np.arange(100) / fs
    for seed in range(MANY - 2):
        u = 13 - (8 + 5 * seed / MANY) * np.cos(2 * np.pi * 50 * t)
        hysteron.simulate("paper-rate", u, fs, seed=seed).save(folder / f"stage-{seed:03}")
    (folder / "broken").mkdir()
    (folder / "broken/dataset.toml").write_text("format = 1\nname = 3\n")
    out = tmp_path_factory.mktemp("many-local")
    paths = [*sorted(folder.iterdir()), folder / "absent"]
    table = rows(fleet.run(paths, out=out, work="fit", workers=2, model="mpi", plays=2))
    assert len(table) == MANY and sum(row["error"] is None for row in table) == MANY - 2
    return folder, table


def descendants(pid: int) -> list[int]:
    """The processes that a process started, and those that they started."""
    parents: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        parents.setdefault(parent, []).append(int(stat.parent.name))
    found, open_ = [], [pid]
    while open_:
        children = parents.get(open_.pop(), [])
        found += children
        open_ += children
    return found


def works(pid: int) -> bool:
    """Whether a process is one that a cluster runs tasks in."""
    try:
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False
    return command.startswith(b"ray::_do") or b"spawn_main" in command


def wait_for(driver: subprocess.Popen, results: Path, count: int) -> int:
    """Waits until there are so many results, and says how many there are."""
    deadline = time.monotonic() + 300
    while (found := len(list(results.glob("[!.]*.json")))) < count:
        assert driver.poll() is None and time.monotonic() < deadline, f"{found} results"
        time.sleep(0.02)
    return found


@pytest.mark.cluster
@pytest.mark.parametrize("engine", ["ray", "dask"])
def test_val_a_cluster_whose_worker_and_driver_are_killed_ends_at_the_same_table(engine, many, tmp_path, capsys):
    folder, table = many
    script = tmp_path / "driver.py"
    script.write_text(DRIVER)
    command = [sys.executable, str(script), str(folder), str(tmp_path / "out"), engine]
    results = tmp_path / "out/results"
    driver = subprocess.Popen(command, start_new_session=True)
    at_worker = wait_for(driver, results, WORKER_DIES)
    workers = [pid for pid in descendants(driver.pid) if works(pid)]
    assert workers, "no worker"
    os.kill(workers[0], signal.SIGKILL)
    at_driver = wait_for(driver, results, DRIVER_DIES)
    assert at_driver < MANY, "the run was over before its driver could be killed"
    family = descendants(driver.pid)
    # The driver, then what it started: a cluster of its own goes with it.
    driver.kill()
    driver.wait()
    for pid in family:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    before = {file: file.stat().st_mtime_ns for file in results.glob("[!.]*.json")}
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert all(file.stat().st_mtime_ns == stamp for file, stamp in before.items())
    assert rows(Path(done.stdout.split()[-1])) == table
    with capsys.disabled():
        print(
            f"{engine}: one of {len(workers)} workers killed at {at_worker} of {MANY} results, the driver at {len(before)}; "
            "none was made again, and the table is that of one machine"
        )
