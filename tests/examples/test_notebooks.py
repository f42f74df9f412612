"""The notebooks run from the first cell to the last, and show pictures and tables."""

from pathlib import Path

import pytest

nbformat = pytest.importorskip(
    "nbformat", reason="nbformat is not installed: the extra `notebook` is missing"
)
nbclient = pytest.importorskip(
    "nbclient", reason="nbclient is not installed: the extra `notebook` is missing"
)

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "notebooks"
SHOWN = {  # notebook: how many outputs are pictures, and the titles of the tables
    "first_run.ipynb": (2, ("Scene", "Operating point at 18 m/s")),
    "compare_controllers.ipynb": (1, ("Leaderboard, 2 case(s), 4 seed(s)", "Task above_rated")),
}


def test_every_notebook_is_listed():
    assert {path.name for path in FOLDER.glob("*.ipynb")} == set(SHOWN)


@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_is_stored_without_outputs(name):
    cells = nbformat.read(FOLDER / name, as_version=4).cells
    assert all(
        not cell.outputs and cell.execution_count is None for cell in cells if cell.cell_type == "code"
    )


@pytest.mark.nightly
@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_runs_and_shows_its_pictures_and_tables(name, tmp_path):
    notebook = nbformat.read(FOLDER / name, as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    data = [output.get("data", {}) for output in outputs]
    pictures, titles = SHOWN[name]
    assert sum("image/png" in found for found in data) == pictures
    tables = "".join(found.get("text/html", "") for found in data)
    assert all(f"<b>{title}" in tables for title in titles)
    printed = "".join(output.get("text", "") for output in outputs if output.output_type == "stream")
    assert "Warning" not in printed, printed
