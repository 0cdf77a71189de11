"""The notebooks of the documentation: they run, and hold what they printed."""

from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "docs" / "notebooks").glob("*.ipynb"))
nbformat = pytest.importorskip("nbformat", reason="needs motorgrad[docs]")
nbclient = pytest.importorskip("nbclient", reason="needs motorgrad[docs]")
pytestmark = pytest.mark.needs("motorgrad[docs]")


def outputs(notebook):
    """What every cell of code left: the kinds of what it showed, and what it printed, in however many pieces."""
    for cell in notebook.cells:
        if cell.cell_type == "code":
            kinds = [sorted(output["data"]) for output in cell.outputs if "data" in output]
            yield kinds, "".join(output.get("text", "") for output in cell.outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_has_been_run_from_top_to_bottom(path):
    notebook = nbformat.read(path, 4)
    counts = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))
    assert sum(bool(kinds or words) for kinds, words in outputs(notebook)) >= 4


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_slider_without_a_kernel_leaves_its_picture_and_fetches_nothing(path):
    notebook = nbformat.read(path, 4)
    assert "widgets" not in notebook.metadata  # a page would fetch a script to show their state
    for cell in notebook.cells:
        if cell.cell_type == "code" and "explore(\n" in cell.source:
            sliders, picture = (output["data"] for output in cell.outputs)
            assert "run this notebook" in sliders["text/plain"]
            assert "image/png" in picture


SHARED = ("a-unit-learns", "bring-your-own-body")  # run by `make test-share`
RUN = [pytest.param(path, marks=[pytest.mark.ci] if path.stem in SHARED else []) for path in NOTEBOOKS]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Jupyter's own
@pytest.mark.parametrize("path", RUN, ids=lambda path: path.stem)
def test_a_notebook_runs_and_leaves_what_it_holds(path, tmp_path, monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)  # or no figure would be shown in the notebook
    held = nbformat.read(path, 4)
    run = nbformat.read(path, 4)
    nbclient.NotebookClient(
        run, timeout=600, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    ).execute()
    for (before, words_before), (after, words_after) in zip(outputs(held), outputs(run), strict=True):
        assert after == before
        # numbers may differ with the processor; what is said about them may not
        assert words_of(words_after) == words_of(words_before)


def words_of(text):
    return [word for word in text.split() if word.isalpha()]


@pytest.mark.slow
@pytest.mark.ci
@pytest.mark.filterwarnings("ignore")  # Jupyter's own
def test_moving_a_slider_draws_its_picture_anew(tmp_path, monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = nbformat.read(next(path for path in NOTEBOOKS if "pool" in path.stem), 4)
    first = next(row for row, cell in enumerate(notebook.cells) if "explore(\n" in cell.source)
    move = """import gc
for slider in [thing for thing in gc.get_objects() if type(thing) is widgets.FloatSlider]:
    slider.value = slider.min"""
    pictures = []
    for extra in ("", move):
        cells = [*notebook.cells[: first + 1], nbformat.v4.new_code_cell(extra)]
        run = nbformat.v4.new_notebook(cells=cells, metadata=notebook.metadata)
        nbclient.NotebookClient(
            run, timeout=600, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
        ).execute()
        pictures.append(run.cells[first].outputs[1]["data"]["image/png"])
    assert pictures[0] != pictures[1]
