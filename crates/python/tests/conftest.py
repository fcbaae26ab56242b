"""What the tests share: the example of the paper's stage, and the program beside the package."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import hysteron


@pytest.fixture(scope="session")
def stage():
    return hysteron.example("paper-stage")


@pytest.fixture(scope="session")
def model(stage):
    return hysteron.fit(stage, "mpi")


@pytest.fixture(scope="session")
def loop_model():
    """Of two slow records, whose hysteresis inverts."""
    fs = 50e3
    u = 13 - 13 * np.cos(2 * np.pi * 20 * np.arange(7500) / fs)
    data = hysteron.simulate("paper-rate", u, fs)
    data.append(0.5 * u, hysteron.simulate("paper-rate", 0.5 * u, fs)[0].y, fs)
    return hysteron.fit(data, "mpi")


@pytest.fixture(scope="session")
def program():
    """Runs the program `hysteron` in a folder and gives its answer as JSON."""
    path = os.environ.get("HYSTERON_PROGRAM")
    if path is None:
        pytest.skip("HYSTERON_PROGRAM names no program; `cargo xtask python` does")

    def run(folder: Path, *arguments: str):
        done = subprocess.run([path, *arguments], cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    run.path = path
    return run
