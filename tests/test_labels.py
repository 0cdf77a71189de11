"""Names that matplotlib would read as formulas, in every figure that shows names."""

import shutil
from xml.etree import ElementTree

import numpy as np
import pytest

import motorgrad as mg
import timsim
from motorgrad._labels import literal
from motorgrad.cli import main

WRONG = r"$\frac{$ and $x_"  # no formula: to draw it as one is an error


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp("finished") / "run"
    return mg.train("three-state", steps=200, seeds=2, out=out, window=50, progress=False).path


@pytest.mark.parametrize("name", [WRONG.replace("/", ""), "_hidden", "$both$"])
def test_names_of_folders_are_shown_as_they_are(name, finished, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for each in (name, "other"):
        shutil.copytree(finished, each)
    assert main(["plot", name, "other", "--out", "out.svg"]) == 0
    assert name in (tmp_path / "out.svg").read_text()


def test_a_name_with_control_characters_leaves_a_figure_that_can_be_read():
    """As it did not: XML has no codes for them."""
    from motorgrad.studies.comparison import _figures

    svg = _figures.panel(lambda axes: axes.set_xlabel(literal("a\x1b[31m\0")), "b\x1b\ud800")
    assert r"a\x1b[31m\x00" in svg
    assert r"b\x1b\ud800" in svg
    ElementTree.fromstring(_figures._with_key(svg, ["c\x07"]).replace("xlink:", ""))


def test_names_of_blocks_are_shown_as_they_are():
    from timlab.blocks import _figure

    figure, axes = _figure.picture()
    _figure.draw_series(axes, np.arange(3.0), np.zeros((1, 3)), 0, WRONG)
    _figure.draw_series(axes, np.arange(3.0), np.ones((1, 3)), 1, "_hidden")
    _figure.finish(axes, WRONG, WRONG, 1, [WRONG, "_hidden"])
    assert figure._repr_png_()
    assert len(axes.get_legend().get_texts()) == 2


def test_names_of_lines_beside_a_film_are_shown_as_they_are():
    from timsim.film._plots import PlotStrip

    time = np.arange(5.0)
    for values in (np.eye(5)[:, :2], -np.eye(5)[:, :2]):
        plot = timsim.Plot(WRONG, time, values, names=(WRONG, "_hidden"))
        assert PlotStrip([plot], 240).at(1.0).any()
