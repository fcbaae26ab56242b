"""A polynomial NARX of sysidentpy on a dataset: `python3 benchmark_narx.py FOLDER` prints the error of each test record, um rms.

Terms of third degree over two past positions and three drives, chosen by forward regression; free simulation.
"""

import sys
import tomllib
from pathlib import Path

import numpy as np

try:
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares
except ImportError as error:
    sys.exit(f"{error}: pip install sysidentpy")

LAGS, TERMS, TRAIN = 3, 20, 8192


def record(folder: Path, file: str) -> tuple[np.ndarray, np.ndarray]:
    lines = (folder / file).read_text().splitlines()
    names = lines[0].split(",")
    data = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    return data[:, [names.index("voltage_v")]], data[:, [names.index("position_um")]]


def main() -> None:
    folder = Path(sys.argv[1])
    records = tomllib.loads((folder / "dataset.toml").read_text())["record"]
    train = [record(folder, r["file"]) for r in records if r["role"] == "identify"]
    u, y = train[0][0][:TRAIN], train[0][1][:TRAIN]
    scale_u, scale_y = u.std(), y.std()
    model = FROLS(
        order_selection=False,
        n_terms=TERMS,
        ylag=LAGS,
        xlag=LAGS,
        basis_function=Polynomial(degree=3),
        estimator=LeastSquares(),
    )
    model.fit(X=u / scale_u, y=y / scale_y)
    for entry in records:
        if entry["role"] == "validate":
            u, y = record(folder, entry["file"])
            modelled = model.predict(X=u / scale_u, y=y[:LAGS] / scale_y) * scale_y
            rms = float(np.sqrt(np.mean((modelled - y) ** 2)))
            print(f"{entry['file']}\t{rms:.3f}")


main()
