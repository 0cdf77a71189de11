"""Refusals name the thing, the value and what is allowed, on one line that can be read."""

from pathlib import Path

import pytest

from motorgrad._errors import MAX_LISTED_NAMES, choice, shown_path, unknown


def test_an_unknown_name_lists_what_is_known_and_guesses_what_was_meant():
    said = str(unknown("task", "hoper", ["hopper", "chain"]))
    assert said == "unknown task 'hoper': did you mean 'hopper'? known are chain, hopper"


def test_of_many_names_the_nearest_are_listed():
    names = [f"setting_{i}" for i in range(2 * MAX_LISTED_NAMES)] + ["baseline"]
    said = str(unknown("setting", "xaseline", names))
    assert "did you mean 'baseline'? known are baseline, " in said
    assert said.endswith(f" and {MAX_LISTED_NAMES + 1} more")
    assert said.count("setting_") == MAX_LISTED_NAMES - 1


def test_a_choice_among_few_names_passes_or_is_refused():
    choice("trace", "episodic", ("episodic", "exponential"))
    with pytest.raises(ValueError, match="did you mean 'episodic'"):
        choice("trace", "episod", ("episodic", "exponential"))


def test_a_path_is_shown_with_its_end():
    usual, endless = Path("/home" + "/folder" * 30, "reach.toml"), "x" * 5000
    assert shown_path(usual) == repr(str(usual))
    assert len(shown_path(endless)) <= 100
