"""The first session of the README, from arrays to a picture.

As a script it checks a package that was installed from its wheel, with its metadata:

    python first_session.py README.md LICENSE-MIT LICENSE-APACHE
"""

import re
import sys
from importlib import metadata
from pathlib import Path

import numpy as np

import hysteron


def arrays() -> dict[str, object]:
    """What a session begins with: two recordings as NumPy arrays, V and um, at 10 kHz.

    The first has loops inside of loops, which show what each play weighs; it is fitted, the other one checks.
    """
    fs = 10e3
    t = np.arange(1500) / fs
    u1 = 13 - 6 * np.cos(2 * np.pi * 20 * t) - 7 * np.cos(2 * np.pi * 60 * t)
    u2 = 13 - 13 * np.cos(2 * np.pi * 20 * t)
    y1, y2 = (
        np.array(hysteron.simulate("paper-delay", u, fs, seed=seed)[0].y) for seed, u in enumerate((u1, u2), start=1)
    )
    return {"u1": u1, "u2": u2, "y1": y1, "y2": y2, "fs": fs}


def lines(page: Path) -> str:
    """The block of a page that makes a dataset of arrays."""
    blocks = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S)
    [block] = [block for block in blocks if "Dataset.from_arrays" in block]
    return block


def session(page: Path, picture: Path) -> dict[str, object]:
    """Runs the block of a page, and draws how the error fell; gives the names that the block leaves."""
    names = arrays()
    exec(compile(lines(page), str(page), "exec"), names)
    steps = names["learned"].ladder.steps
    assert steps[-1]["validate_percent"] < 0.1 * steps[0]["validate_percent"], steps
    names["learned"].plot().savefig(picture)
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 5000
    return names


def installed(licences: list[Path]) -> None:
    """Metadata and licences of the package that is installed."""
    assert Path(hysteron.__file__).is_relative_to(sys.prefix), hysteron.__file__
    about = metadata.metadata("hysteron")
    assert about["Version"] == hysteron.__version__
    assert about["License-Expression"] == "MIT OR Apache-2.0"
    assert about["Requires-Python"] == ">=3.10" and about["Summary"] and about["Keywords"]
    assert "hysteron.learn(data)" in about.get_payload()
    assert "Typing :: Typed" in about.get_all("Classifier")
    held = {Path(str(file)).name: file for file in metadata.files("hysteron")}
    assert "py.typed" in held and "_hysteron.pyi" in held
    for licence in licences:
        assert held[licence.name].read_text() == licence.read_text(encoding="utf-8"), licence


if __name__ == "__main__":
    import matplotlib

    matplotlib.use("agg")
    readme, *texts = map(Path, sys.argv[1:])
    installed(texts)
    session(readme, Path(sys.prefix) / "error-falls.png")
    print(f"hysteron {hysteron.__version__}: the lines of {readme} from arrays to a picture")
