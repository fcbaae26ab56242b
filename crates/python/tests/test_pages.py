"""What pages and notebooks say is run."""

from pathlib import Path

import first_session
import numpy as np
import pytest

import hysteron

PACKAGE = Path(__file__).parents[1]
ROOT = PACKAGE.parents[1]


@pytest.mark.parametrize("page", [ROOT / "README.md", PACKAGE / "README.md", ROOT / "docs/python.md"], ids=str)
def test_val_the_lines_of_a_page_lead_from_arrays_to_a_picture(page, tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    names = first_session.session(page, tmp_path / "error-falls.png")
    matplotlib.pyplot.close("all")
    assert isinstance(names["learned"], hysteron.Learned) and isinstance(names["u1"], np.ndarray)


def test_val_the_wheel_gets_the_licences_of_the_repository():
    for name in ("LICENSE-MIT", "LICENSE-APACHE"):
        assert (PACKAGE / name).read_text(encoding="utf-8") == (ROOT / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("notebook", sorted((ROOT / "docs/notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_val_a_notebook_runs(notebook, tmp_path):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    cells = nbformat.read(notebook, as_version=4)
    nbformat.validate(cells)
    # Kept without outputs: what a notebook shows is made where it is opened.
    assert not any(cell.get("outputs") for cell in cells.cells)
    ran = nbclient.NotebookClient(cells, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    assert any(output.output_type == "execute_result" for cell in ran.cells for output in cell.get("outputs", ()))


def test_val_there_are_three_notebooks_and_the_page_has_them():
    page = (ROOT / "docs/python.md").read_text(encoding="utf-8")
    names = sorted(path.name for path in (ROOT / "docs/notebooks").glob("*.ipynb"))
    assert len(names) == 3 and all(f"notebooks/{name}" in page for name in names)
