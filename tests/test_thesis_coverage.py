"""The page of what the thesis says and where it is here: it is that of the registries."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
pytestmark = [pytest.mark.needs("motorgrad[thesis]"), pytest.mark.needs("motorgrad[lab]")]


@pytest.fixture(scope="module")
def tool():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        from tools import thesis_coverage

        yield thesis_coverage


def test_the_page_is_made_of_the_registries(tool):
    written = tool.PAGE.read_text(encoding="utf-8")
    assert written == tool.page(), "run `python -m tools.thesis_coverage`"


def test_every_experiment_belongs_to_something_that_the_thesis_says(tool):
    assert tool.named() == set(tool.EXPERIMENTS)


@pytest.mark.parametrize("reference", ["trace:exponental", "python:motorgrad.worlds.Partcle", "tracer:exponential"])
def test_a_place_that_does_not_exist_is_refused(reference, tool):
    with pytest.raises(ValueError, match=r"exponental|Partcle|tracer"):
        tool.shown(reference)
