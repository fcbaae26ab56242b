"""Throughput of the engines of a fleet, in one run: processes of this machine, Ray, Dask.

    python crates/python/benches/fleet.py [DATASETS] [learn|diagnose|fit]

Datasets have 60 000 samples. Each engine has two workers. Clusters stand before the clock starts, as on a site; the
processes of this machine are started within it. Rounds go over the engines in turn, and the best of each counts, so that
other work on the machine slows all of them.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import hysteron
from hysteron import fleet

SAMPLES = 60_000
WORKERS = 2
ROUNDS = 3


def stages(folder: Path, count: int) -> list[Path]:
    """Datasets of two records each, at 50 kHz."""
    fs, half = 50e3, SAMPLES // 2
    t = np.arange(half) / fs
    paths = []
    for seed in range(count):
        data = hysteron.simulate("paper-rate", 13 - 13 * np.cos(2 * np.pi * 20 * t), fs, seed=seed)
        u = 13 - 6 * np.cos(2 * np.pi * 30 * t) - 7 * np.cos(2 * np.pi * 170 * t)
        judge = hysteron.simulate("paper-rate", u, fs, seed=seed + count)
        data.append(u, judge[0].y, fs, role="validate", name="judge")
        data.save(folder / f"stage-{seed}")
        paths.append(folder / f"stage-{seed}")
    return paths


def main(count: int, work: str) -> None:
    import ray
    from distributed import LocalCluster

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = stages(folder / "stages", count)
        began = time.perf_counter()
        for path in paths:
            fleet.key(path, work, {})
        print(f"key of a dataset, read from the disk's cache: {(time.perf_counter() - began) / count * 1e3:.1f} ms")
        ray.init(num_cpus=WORKERS, include_dashboard=False, logging_level="ERROR")
        with LocalCluster(n_workers=WORKERS, threads_per_worker=1, dashboard_address=None) as cluster:
            engines = {"local": {}, "ray": {}, "dask": {"address": cluster.scheduler_address}}
            # A first dataset each: the workers' imports.
            for engine, where in engines.items():
                fleet.run(paths[:WORKERS], out=folder / f"{engine}-first", engine=engine, work=work, workers=WORKERS, **where)
            best = dict.fromkeys(engines, float("inf"))
            for round_ in range(ROUNDS):
                for engine, where in engines.items():
                    out = folder / f"{engine}-{round_}"
                    began = time.perf_counter()
                    table = fleet.run(paths, out=out, engine=engine, work=work, workers=WORKERS, **where)
                    best[engine] = min(best[engine], time.perf_counter() - began)
                    size = sum(file.stat().st_size for file in (out / "results").iterdir())
        for engine, taken in best.items():
            print(f"{engine:<6} {3600 * count / taken:8.0f} datasets an hour, {best['local'] / taken:.2f} of local")
        print(f"{size / count / 1e3:.0f} kB a result, {table.stat().st_size / count:.0f} bytes of the table a dataset")
        began = time.perf_counter()
        fleet.run(paths, out=out, work=work)
        print(f"a run in which all is done already: {(time.perf_counter() - began) / count * 1e3:.1f} ms a dataset")


if __name__ == "__main__":
    arguments = sys.argv[1:]
    main(int(arguments[0]) if arguments else 12, arguments[1] if len(arguments) > 1 else "learn")
