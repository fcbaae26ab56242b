"""The same work on many datasets: on this machine, on a Ray cluster, on a Dask cluster.

Each dataset has one result file under a key of its content, the version and the options. A file is written under another
name and then renamed: where it is present, the work is done. A run that was ended goes on where it stopped.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import uuid
import warnings
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

from ._hysteron import Error, Model, __version__, compare, diagnose, fit, learn, read

Engine = Literal["local", "ray", "dask"]
Work = Literal["learn", "diagnose", "fit"]

# Tasks that a cluster holds at a time: enough for hundreds of workers, few enough for any scheduler's memory.
IN_FLIGHT = 2000

# Columns of the table.
COLUMNS = (
    "path",
    "key",
    "error",
    "verdict",
    "effects",
    "first_percent",
    "last_percent",
    "noise_rms_um",
    "stop",
)


def run(
    paths: Iterable[str | Path],
    *,
    out: str | Path,
    engine: Engine = "local",
    work: Work = "learn",
    workers: int | None = None,
    address: str | None = None,
    **options: Any,
) -> Path:
    """Learns, diagnoses or fits each dataset, and gives the path of the table with a row for each.

    ``out`` is a folder that all workers see. ``workers`` is the number of processes here; ``address`` is that of a
    cluster, else one is started on this machine. ``options`` go to `hysteron.learn`, or, with ``work="diagnose"`` and
    ``work="fit"``, to `hysteron.fit`. A dataset that cannot be read or fitted is a row with its error.
    """
    if work not in ("learn", "diagnose", "fit"):
        raise Error(f"work {work!r}: there are 'learn', 'diagnose' and 'fit'")
    engines = {"local": _local, "ray": _ray, "dask": _dask}
    if engine not in engines:
        raise Error(f"engine {engine!r}: there are {', '.join(map(repr, engines))}")
    # A worker may stand in another folder.
    folder = Path(out).resolve()
    (folder / "results").mkdir(parents=True, exist_ok=True)
    tasks = [(str(Path(path).resolve()), str(folder), work, dict(options)) for path in paths]
    # Reading and hashing leave the interpreter free.
    with ThreadPoolExecutor() as pool:
        keys = list(pool.map(lambda task: key(task[0], work, options), tasks))
    # Two paths with the same content are one piece of work.
    open_tasks = {name: task for name, task in zip(keys, tasks) if not _file(folder, name).exists()}
    for _ in engines[engine](list(open_tasks.values()), workers, address):
        pass
    rows = [_row(task[0], name, _file(folder, name)) for name, task in zip(keys, tasks)]
    return _write_table(folder, rows)


def key(path: str | Path, work: str, options: Mapping[str, Any]) -> str:
    """The name of a dataset's result: a hash of its content, the version, the work and its options."""
    digest = hashlib.sha256()
    digest.update(json.dumps([__version__, work, options], sort_keys=True, default=str).encode())
    place = Path(path)
    files = sorted(p for p in place.rglob("*") if p.is_file()) if place.is_dir() else [place]
    for file in files:
        digest.update(f"\0{file.relative_to(place)}\0".encode() if place.is_dir() else b"\0")
        try:
            with open(file, "rb") as content:
                while block := content.read(1 << 20):
                    digest.update(block)
        except OSError as refused:
            # What cannot be read has no content; its row says why. Once it can be read, its key is another.
            digest.update(f"\0{place}\0{refused.errno}".encode())
    return digest.hexdigest()[:32]


def result(path: str | Path, out: str | Path, work: Work = "learn", **options: Any) -> dict[str, Any]:
    """The whole result of one dataset, as its file has it; a model is in ``["model"]`` as the text of its file."""
    answer: dict[str, Any] = json.loads(_file(Path(out), key(path, work, options)).read_text(encoding="utf-8"))
    return answer


def _file(folder: Path, name: str) -> Path:
    return folder / "results" / f"{name}.json"


def _do(task: tuple[str, str, str, dict[str, Any]]) -> str:
    """One dataset, in whatever process this is. Every engine maps this function."""
    path, folder, work, options = task
    # Datasets side by side use the cores already.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    name = key(path, work, options)
    target = _file(Path(folder), name)
    if target.exists():
        return name
    try:
        answer = _answer(path, work, options)
    except Error as refused:
        answer = {"error": str(refused)}
    # Beside its place, then into it: two workers at the same dataset do no harm.
    beside = target.with_name(f".{name}.{uuid.uuid4().hex}.part")
    beside.write_text(json.dumps(answer, sort_keys=True), encoding="utf-8")
    os.replace(beside, target)
    return name


def _answer(path: str, work: str, options: dict[str, Any]) -> dict[str, Any]:
    with warnings.catch_warnings():
        # Remarks on recordings belong to whoever reads one of them.
        warnings.simplefilter("ignore")
        dataset = read(path)
    if work == "learn":
        learned = learn(dataset, progress=False, **options)
        answer = learned.to_dict()
        return {"diagnosis": answer.pop("diagnosis"), "learned": answer, "model": learned.model.to_toml()}
    model: Model = fit(dataset, progress=False, **options)
    answer = {"compared": compare(dataset, model, progress=False).to_dict(), "model": model.to_toml()}
    if work == "diagnose":
        answer["diagnosis"] = diagnose(dataset, model, progress=False).to_dict()
    return answer


def _local(tasks: list[Any], workers: int | None, address: str | None) -> Iterator[str]:
    """Processes of this machine."""
    if not tasks:
        return
    count = min(len(tasks), workers or os.cpu_count() or 1)
    # A fork would copy the threads' locks of whatever the caller runs.
    with ProcessPoolExecutor(count, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(_do, task) for task in tasks]):
            yield done.result()


def _ray(tasks: list[Any], workers: int | None, address: str | None) -> Iterator[str]:
    """Tasks of a Ray cluster."""
    import ray

    if not ray.is_initialized():
        ray.init(address=address, num_cpus=None if address else workers, include_dashboard=False)
    remote = ray.remote(max_retries=3)(_do)
    to_come = iter(tasks)
    waiting = [remote.remote(task) for task in islice(to_come, IN_FLIGHT)]
    while waiting:
        done, waiting = ray.wait(waiting)
        waiting += [remote.remote(task) for task in islice(to_come, len(done))]
        yield from ray.get(done)


def _dask(tasks: list[Any], workers: int | None, address: str | None) -> Iterator[str]:
    """Tasks of a Dask cluster."""
    from distributed import Client, LocalCluster
    from distributed import as_completed as completed

    if address:
        to_come = iter(tasks)
        with Client(address) as client:
            going = completed(client.map(_do, list(islice(to_come, IN_FLIGHT)), pure=False))
            for done in going:
                for task in islice(to_come, 1):
                    going.add(client.submit(_do, task, pure=False))
                yield done.result()
        return
    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        yield from _dask(tasks, workers, cluster.scheduler_address)


def _row(path: str, name: str, file: Path) -> dict[str, Any]:
    """A dataset's row of the table."""
    answer = json.loads(file.read_text(encoding="utf-8"))
    row: dict[str, Any] = dict.fromkeys(COLUMNS) | {"path": path, "key": name, "error": answer.get("error")}
    if row["error"] is not None:
        return row
    if diagnosis := answer.get("diagnosis"):
        row["verdict"] = diagnosis["verdict"]
        row["noise_rms_um"] = diagnosis["noise_rms_um"]
        row["first_percent"] = row["last_percent"] = _counts(diagnosis["before"])
    else:
        compared = answer["compared"]
        row["noise_rms_um"] = compared["noise_rms_um"]
        judged = compared["validate"] or compared["identify"]
        row["first_percent"] = row["last_percent"] = judged["nrmse_percent"]
    if learned := answer.get("learned"):
        row["effects"] = " ".join(effect["name"] for effect in learned["effects"])
        row["stop"] = learned["stop"]["why"]
        if learned["ladder"]:
            row["first_percent"] = _counts(learned["ladder"]["steps"][0])
    return row


def _counts(errors: Mapping[str, Any]) -> float | None:
    """The error that counts: on records not fitted to, else on those that were."""
    judged = errors.get("validate_percent")
    return errors.get("identify_percent") if judged is None else judged


def _write_table(folder: Path, rows: list[dict[str, Any]]) -> Path:
    """Parquet where pyarrow is installed, else CSV; whole or not at all."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        target = folder / "table.csv"
        beside = target.with_suffix(".part")
        with open(beside, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
    else:
        target = folder / "table.parquet"
        beside = target.with_suffix(".part")
        numbers = {"first_percent", "last_percent", "noise_rms_um"}
        types = [(name, pyarrow.float64() if name in numbers else pyarrow.string()) for name in COLUMNS]
        parquet.write_table(pyarrow.Table.from_pylist(rows, schema=pyarrow.schema(types)), beside)
    os.replace(beside, target)
    return target
