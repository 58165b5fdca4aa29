"""The notebook of the docs runs from top to bottom and shows its outputs."""

from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

NOTEBOOK = Path(__file__).parents[2] / "docs" / "python.ipynb"


def test_the_notebook_runs_from_top_to_bottom():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs must not be stored in the file"
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3").execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = [output for output in shown if "image/png" in output.get("data", {})]
    pages = [output for output in shown if "text/html" in output.get("data", {})]
    assert len(pictures) == 4 and len(pages) >= 3
    text = "".join(str(output) for output in shown)
    for part in ["samples per second", "lag", "srcdoc", "3 of 3 actuators diagnosed", "lag_seconds"]:
        assert part in text, part
