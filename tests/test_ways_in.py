"""However a value is given, it is at most eight calls from the field that checks it, and no function is called twice.

The ways through the pages are walked beside them: TimSim's in apps/timsim/tests/live/test_live_worker.py and
apps/timsim/tests/panels/test_panels_session.py, TimLab's in apps/timlab/tests/editor/.
"""

import pytest

from motorgrad.cli import main
from motorgrad.training import agent_for
from ways_in import assert_short, calls_to


def by_a_word(_):
    main(["train", "hopper", "--check", "--agent.decay", "0.98"])


def by_a_key_of_a_file(folder):
    (folder / "options.toml").write_text("[agent]\ndecay = 0.98\n")
    main(["train", "hopper", "--check", "--config", str(folder / "options.toml")])


def by_a_path_in_a_file(folder):
    (folder / "options.toml").write_text('[agent.estimator.trace]\nkind = "exponential"\ndecay = 0.98\n')
    main(["train", "hopper", "--check", "--config", str(folder / "options.toml")])


def by_a_keyword(_):
    agent_for("hopper", decay=0.98)


def by_a_path(_):
    agent_for("hopper", {"estimator.trace.decay": 0.98})


@pytest.mark.parametrize("given", [by_a_word, by_a_key_of_a_file, by_a_path_in_a_file, by_a_keyword, by_a_path])
def test_a_value_is_near_the_field_that_checks_it(given, tmp_path, capsys):
    calls = calls_to("decay", 0.98, lambda: given(tmp_path))
    assert_short(calls)
