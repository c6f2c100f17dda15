"""The notebooks run from top to bottom."""

from __future__ import annotations

from pathlib import Path

import jupytext
import pytest
from executed import executed, executed_pages
from nbclient.exceptions import CellExecutionError

from swgjoint.gear.design.design import Design
from swgjoint.maps.drive_map import DriveMap

STORIES = {
    "first-drive",
    "wave-generators",
    "micro-geometry",
    "spec-check",
    "error-against-time",
    "control",
    "identification",
    "reinforcement-learning",
    "sweeps",
    "hot-paths",
}
FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.py"))
MAPS = sorted(FOLDER.glob("maps/*.swg"))


def test_there_are_notebooks():
    """The folder is found, so the tests below run something."""
    assert MAPS
    assert {path.stem for path in NOTEBOOKS} >= STORIES


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_opens_as_a_notebook(path):
    """Jupytext reads text and code cells, starting with a title."""
    notebook = jupytext.read(path, fmt="py:percent")
    kinds = [cell.cell_type for cell in notebook.cells]
    assert notebook.cells[0].source.startswith("# ")
    assert {"markdown", "code"} == set(kinds)
    assert notebook.metadata.kernelspec.name == "python3"


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_stored_maps_are_of_the_bundled_designs(path):
    """A design that was changed wants its map built again, by the command beside it."""
    drive, design = DriveMap.load(path), Design.load(path.stem)
    assert drive.info["design_hash"] == design.content_hash()
    assert drive.info["label"]["model"] == "2d"


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs(path):
    """Every cell runs without error or warning in an empty folder, which stays so.

    The notebook has a picture for the gallery and says nothing on stderr.
    """
    notebook = executed(path)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in cells if cell.source.strip())
    outputs = [output for cell in cells for output in cell.outputs]
    assert [out.text for out in outputs if out.get("name") == "stderr"] == []
    assert executed_pages().thumbnail(notebook).startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_failing_notebook_is_noticed(tmp_path):
    """A warning, and a file that is left behind."""
    path = tmp_path / "one.py"
    for line, error in (
        ("warnings.warn('old', DeprecationWarning)", CellExecutionError),
        ("open('left.txt', 'w').close()", RuntimeError),
    ):
        path.write_text(f"# %% [markdown]\n# # One\n\n# %%\nimport warnings\n{line}\n")
        with pytest.raises(error, match=r"old|left\.txt"):
            executed_pages().execute(path)
