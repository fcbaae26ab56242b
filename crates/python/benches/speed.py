"""Rates of the law from Python, and what Python adds to the command line on 60 000 samples.

    python crates/python/benches/speed.py                          # the law
    python crates/python/benches/speed.py target/debug/hysteron    # and the overhead over that program

The program and the package must be built alike, or the difference is that of their compilers' options.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import hysteron

# Samples of the dataset whose fit is timed.
SAMPLES = 60_000
# Rounds; in each the program and the package run one after the other, so that a busy machine slows both.
ROUNDS = 9

# What both are asked for: the program's options, and the call in Python.
WORK = {
    "fit": (["--model", "mrpi"], "hysteron.fit(hysteron.read('data'), 'mrpi', progress=False)"),
    "learn": ([], "hysteron.learn(hysteron.read('data'), progress=False).model"),
}


def seconds(work) -> float:
    """How long a call takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def dataset() -> hysteron.Dataset:
    """Two records of a simulated stage at 50 kHz."""
    fs, half = 50e3, SAMPLES // 2
    t = np.arange(half) / fs
    volts = [13 - 13 * np.cos(2 * np.pi * 20 * t), 13 - 6 * np.cos(2 * np.pi * 30 * t) - 7 * np.cos(2 * np.pi * 170 * t)]
    positions = [hysteron.simulate("paper-rate", u, fs, seed=seed)[0].y for seed, u in enumerate(volts)]
    return hysteron.Dataset.from_arrays(volts, positions, fs, role=["identify", "validate"])


def law() -> None:
    """Steps a second of the law in both number types."""
    model = hysteron.fit(dataset(), "mpi", progress=False)
    controller = hysteron.design(model, volts=(0.0, 26.0), open=True, progress=False)
    reference = 0.65 - 0.65 * np.cos(2 * np.pi * 50 * np.arange(200_000) / controller.fs)
    for kind in ("f32", "f64"):
        running = controller.law(kind)
        block = min(seconds(lambda: running.step(reference, reference)) for _ in range(ROUNDS))
        values = [float(value) for value in reference]

        def one_by_one() -> None:
            step = running.step
            for value in values:
                step(value, value)

        single = min(seconds(one_by_one) for _ in range(ROUNDS))
        rates = [len(reference) / taken for taken in (block, single)]
        print(f"law.step in {kind}: {rates[0]:.2e} a second in blocks, {rates[1]:.2e} one by one")


def overhead(program: str) -> None:
    """The same work by the program, a process from its start to its model's file, and by a call in a running interpreter."""
    start = min(seconds(lambda: subprocess.run([sys.executable, "-c", "import hysteron"], check=True)) for _ in range(ROUNDS))
    print(f"interpreter, NumPy and the import of the package: {start:.3f} s")
    for work, (options, call) in WORK.items():
        with tempfile.TemporaryDirectory() as folder:
            dataset().save(Path(folder) / "data")
            command = [program, work, "data", *options, "-o", "program.toml", "--json"]
            script = f"import hysteron, time; began = time.perf_counter(); {call}.save('package.toml')"
            script = [sys.executable, "-c", f"{script}; print(time.perf_counter() - began)"]

            def printed(words: list[str]) -> str:
                return subprocess.run(words, cwd=folder, check=True, stdout=subprocess.PIPE, text=True).stdout

            rounds = [(seconds(lambda: printed(command)), float(printed(script).split()[-1])) for _ in range(ROUNDS)]
            by_program, by_package = np.array(rounds).min(axis=0)
            files = [(Path(folder) / name).read_bytes() for name in ("program.toml", "package.toml")]
            assert files[0] == files[1], f"{work}: the two models differ"
        print(
            f"{work} of {SAMPLES} samples: {by_program:.3f} s by the program, {by_package:.3f} s by the package, "
            f"{100 * (by_package / by_program - 1):+.1f} %"
        )


if __name__ == "__main__":
    law()
    for name in sys.argv[1:]:
        overhead(str(Path(name).resolve()))
