"""The score: statements of the thesis, counted once each; and the thesis's number of episodes."""

import itertools
import json
from pathlib import Path

import pytest

from motorgrad.statistics import exact
from motorgrad_thesis import (
    EXPERIMENTS,
    above,
    negative,
    positive,
    score_rows,
    score_words,
    standing,
    statements,
)
from motorgrad_thesis._claims import claim_source
from motorgrad_thesis._score import STANDINGS
from motorgrad_thesis.chapter_5.hexapod.section_5_3_4_episodes import (
    Episodes,
    approximate_chance,
    chance,
    episodes,
)


@pytest.fixture(scope="module")
def score():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[2]))
        import tools.score

        yield tools.score


def claim(verdict, of="", kind="thesis", untested=""):
    return {
        **{"statement": f"It is {verdict}.", "verdict": verdict, "source": "section 1.1", "finding": "3 m"},
        **{"of": of, "kind": kind, "untested": untested},
    }


def record(name, part, *claims):
    return {"name": name, "part": part, "claims": claims}


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [
        (("holds", "holds"), "holds"),
        (("holds", "undecided"), "undecided"),
        (("holds", "undecided", "refuted"), "refuted"),
        (("holds", "not run yet", "refuted"), "not run yet"),
    ],
)
def test_a_statement_holds_if_all_its_variants_do_and_is_refuted_by_one(verdicts, expected):
    for order in itertools.permutations(verdicts):
        assert standing(map(claim, order)) == expected


def test_variants_that_do_not_test_a_statement_leave_it_to_the_others():
    other = claim("refuted", untested="The learner is ours.")
    assert standing([claim("holds"), other]) == "holds"
    assert standing([other, other]) == "not testable"


def test_statements_of_the_thesis_count_once_and_others_not_at_all():
    found = statements(
        [
            record("one", "chapter-3", *(claim("refuted", "It is best.") for _ in range(5)), claim("holds")),
            record(
                "two",
                "appendix-a",
                claim("holds", "It is best."),  # in another experiment: another statement
                claim("refuted", kind="extension"),
                claim("refuted", kind="reference model"),
                claim("refuted", untested="The length is ours."),
            ),
        ]
    )
    assert [(each.words, each.claims, each.standing, each.reasons) for each in found] == [
        ("It is best.", 5, "refuted", ("3 m",)),
        ("It is holds.", 1, "holds", ()),
        ("It is best.", 1, "holds", ()),
        ("It is refuted.", 1, "not testable", ("The length is ours.",)),
    ]
    assert score_rows(found) == [
        ("chapter 3", 2, 1, 1, 0, 0, 0),
        ("appendix a", 2, 1, 0, 0, 1, 0),
        ("all", 4, 2, 1, 0, 1, 0),
    ]
    words = "of 4 statements of the thesis, 2 hold, 1 are refuted, 0 are undecided, 1 are not testable"
    assert score_words(found) == words


def test_a_claim_says_whose_it_is_and_where_by_default():
    ours, model, theirs = (positive("So.", exact(1), kind=kind) for kind in ("extension", "reference model", "thesis"))
    sources = [claim_source(each, "figure 1.1") for each in (ours, model, theirs)]
    assert sources == ["our own expectation", "an independent model", "figure 1.1"]
    assert claim_source(above(0, "So.", exact(1), kind="extension", source="hearsay"), "figure 1.1") == "hearsay"
    assert negative("So.", exact(1)).kind == "thesis"
    with pytest.raises(ValueError, match="unknown kind 'theses'"):
        positive("So.", exact(1), kind="theses")


def test_the_episodes_of_section_5_3_4_are_three_for_55_percent():
    # P(28 or more of 50 heads) = 0.2399, from tables; (1 − p)^n falls below one half with the third episode
    assert float(chance(28, 50)) == pytest.approx(0.2399438, abs=1e-7)
    assert 0.7600562**3 < 0.5 < 0.7600562**2
    study = Episodes()
    refuted, other = study.claims(study.run(None))
    assert (refuted.measured.value, refuted.verdict, refuted.kind) == (3, "refuted", "thesis")
    # 95 %: by the Gaussian approximation of the thesis's footnote 7·10⁹, by the binomial tail 6·10¹¹
    assert other.holds
    assert other.kind == "extension"
    assert episodes(approximate_chance(0.95, 50)) == pytest.approx(7.0e9, rel=0.02)
    tail = (1 + 50 + 50 * 49 / 2) / 2**50
    assert episodes(chance(48, 50)) == pytest.approx(0.6931472 / tail, rel=1e-6)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_says_how_it_reads_the_thesis(name):
    reading = EXPERIMENTS[name].reading
    assert reading == "" or reading.endswith(".")


def test_the_page_opens_with_the_table_of_the_results_on_record(score):
    data = json.loads(score.DATA.read_text())
    page = score.PAGE.read_text()
    assert page == score.drawn(page, score.recorded(data)), "docs/reproduction.md: run python -m tools.score"
    assert page.index(score.START) < page.index("## ")
    assert set(data) <= set(EXPERIMENTS)
    assert list(data) == [name for name in EXPERIMENTS if name in data]
    words = [(name, each["words"]) for name, found in data.items() for each in found]
    assert len(words) == len(set(words))
    for each in score.recorded(data):
        assert each.standing in STANDINGS
        assert each.reasons or each.standing not in ("refuted", "not testable"), each.words


def test_new_records_replace_those_of_their_experiment_and_keep_reasons_that_still_apply(score):
    old = {
        "words": "It is refuted.",
        "source": "section 1.1",
        "claims": 1,
        "standing": "refuted",
        "reasons": ["Because."],
    }
    data = {"fig-6.1": [old], "fig-a.1": [old], "fig-2.2": [old]}
    made = score.updated(data, [record("fig-6.1", "chapter-6", claim("refuted"), claim("holds"))])
    assert list(made) == ["fig-2.2", "fig-6.1", "fig-a.1"]
    assert made["fig-a.1"] == [old]
    assert [(each["words"], each["reasons"]) for each in made["fig-6.1"]] == [
        ("It is refuted.", ["Because."]),
        ("It is holds.", []),
    ]
