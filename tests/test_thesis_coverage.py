"""The page of what the thesis says and where it is here: it is that of the registries."""

import pytest

pytest.importorskip("motorgrad_thesis")
pytest.importorskip("timlab")

from tools import thesis_coverage


def test_the_page_is_made_of_the_registries():
    written = thesis_coverage.PAGE.read_text(encoding="utf-8")
    assert written == thesis_coverage.page(), "run `python -m tools.thesis_coverage`"


def test_every_experiment_belongs_to_something_that_the_thesis_says():
    assert thesis_coverage.named() == set(thesis_coverage.EXPERIMENTS)


@pytest.mark.parametrize("reference", ["trace:exponental", "python:motorgrad.worlds.Partcle", "tracer:exponential"])
def test_a_place_that_does_not_exist_is_refused(reference):
    with pytest.raises(ValueError, match=r"exponental|Partcle|tracer"):
        thesis_coverage.shown(reference)
