"""Settings as tables: what is built is what was meant, and whatever is refused is refused by name."""

import dataclasses
import math
import tomllib

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorgrad._settings import build, table
from motorgrad.bodies import Hopper as HopperBody
from motorgrad.bodies import Muscle
from motorgrad.cli import main
from motorgrad.tasks import TASKS, make
from motorgrad.training import ESTIMATORS, AgentSettings, load, settings_for

CLASSES = {**TASKS, "agent": AgentSettings, "body": HopperBody, "muscle": Muscle}

words = st.sampled_from(
    ["softmax", "hyperplanes", "walk", "reset", "olgarb", "never", "episode", "spring", "native", "inf"]
)
numbers = st.one_of(st.integers(), st.integers(-2, 20), st.floats(), st.floats(0, 1))
scalars = st.one_of(st.none(), st.booleans(), numbers, words, st.text(max_size=8))
values = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.sampled_from(["body", "position", "name", "x", "load_mass"]), inner, max_size=3),
    ),
    max_leaves=6,
)


@pytest.mark.parametrize("name", CLASSES)
@given(data=st.data())
@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_any_table_makes_an_instance_or_is_refused_by_name(name, data):
    cls = CLASSES[name]
    keys = [field.name for field in dataclasses.fields(cls)]
    drawn = data.draw(st.dictionaries(st.sampled_from([*keys, "unknown"]), values, max_size=3))
    try:
        made = build(cls, drawn, name)
    except ValueError as error:
        refused = str(error)
    else:
        assert isinstance(made, cls)
        assert set(drawn) <= set(keys)
        assert build(cls, table(made), name) == made
        return
    # what is named was given, or was left out
    assert any(key in refused for key in [*drawn, *keys])


@pytest.mark.parametrize("name", TASKS)
def test_a_task_survives_its_own_table_in_toml(name):
    task = TASKS[name]()
    assert build(TASKS[name], tomllib.loads(tomli_w.dumps(table(task)))) == task


@pytest.mark.parametrize("name", TASKS)
def test_a_tasks_learner_is_made_of_settings_that_exist(name):
    learner = settings_for(make(name))
    assert learner == dataclasses.replace(AgentSettings(), **dict(make(name).learner))
    assert build(AgentSettings, table(learner)) == learner
    learner.agent(make(name))


def test_changes_go_through_the_table():
    task = make("hopper", penalty=0.3, body={"knee_range": [50, 140], "extra_muscles": []})
    assert make("hopper", **table(task)) == task
    assert task.body.knee_range == (50.0, 140.0)


REFUSED = [
    ({"polcy": "softmax"}, "unknown setting of agent 'polcy': did you mean 'policy'"),
    ({"policy": "softmx"}, "unknown policy 'softmx': did you mean 'softmax'"),
    ({"estimator": "olgarp"}, "'olgarp': did you mean 'olgarb'"),
    ({"trace": "windows"}, "'windows': did you mean 'window'"),
    ({"baseline": "means"}, "'means': did you mean 'mean'"),
    ({"ascent": "adams"}, "'adams': did you mean 'adam'"),
    ({"batch": "summ"}, "'summ': did you mean 'sum'"),
    ({"decay": 1.0}, r"decay = 1.0: must be in \[0, 1\)"),
    ({"decay": -0.1}, "decay = -0.1"),
    ({"decay": "0.9"}, "agent.decay = '0.9': must be a finite number"),
    ({"decay": math.nan}, "agent.decay = nan: must be a finite number"),
    ({"rate": 10**400}, "agent.rate = 1.*: must be a finite number"),
    ({"rate": -1.0}, "rate = -1.0"),
    ({"rates": {"weights": -1.0}}, "weights = -1.0"),
    ({"rates": {"weights": "fast"}}, "agent.rates = .*'fast'"),
    ({"rates": [1.0]}, r"agent.rates = \[1.0\]"),
    ({"improve": 0}, "improve = 0"),
    ({"improve": True}, "'?True'?"),
    ({"improve": "always"}, "'always'"),
    ({"discount": 0.0}, "discount = 0.0"),
    ({"discount": 1.5}, "discount = 1.5"),
    ({"trace": "window", "length": 0}, "length = 0"),
    ({"trace": "window", "length": 2.5}, "agent.length = 2.5: must be an integer"),
    ({"trace": "lagged-gaussian", "width": 0.0}, "width = 0.0"),
    ({"baseline": "fixed-step", "baseline_rate": 2.0}, "rate = 2.0"),
    ({"units": 0}, "units|outputs"),
]


@pytest.mark.parametrize(("changes", "named"), REFUSED, ids=[str(changes)[:40] for changes, _ in REFUSED])
def test_impossible_learners_are_refused_by_name(changes, named):
    task = make("hopper")
    with pytest.raises(ValueError, match=named):
        settings_for(task, **changes).agent(task)


@pytest.mark.parametrize("name", ["improve", "units", "discount", "rates"])
def test_none_leaves_a_setting_to_its_default(name):
    assert getattr(settings_for(make("hopper"), **{name: None}), name) is None


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_named_estimator_stands_for_its_parts_unless_they_are_given(name):
    parts = ESTIMATORS[name]
    plain = settings_for(make("hopper"), estimator=name)
    assert plain.estimate() == dataclasses.replace(plain, **parts).estimate()
    assert settings_for(make("hopper"), estimator=name, improve=7, baseline="fixed-step").estimate().improve == 7


def test_what_must_be_given_is_asked_for_by_name():
    with pytest.raises(ValueError, match=r"body\.extra_muscles\[0\]\.group: must be given"):
        build(HopperBody, {"extra_muscles": [{"name": "helper"}]}, "body")


@pytest.mark.parametrize("one", ["rate", "damping", "weight_decay"])
def test_one_number_for_all_takes_the_place_of_the_tasks_own_by_group(one):
    changed = settings_for("arm-recruitment", **{one: 0.5})
    assert (getattr(changed, one), getattr(changed, f"{one}s")) == (0.5, None)
    groups = {"gain": 0.1, "threshold": 0.2}
    both = settings_for("arm-recruitment", **{one: 0.5, f"{one}s": groups})
    assert (getattr(both, one), getattr(both, f"{one}s")) == (0.5, groups)


def test_the_commands_rate_for_all_takes_the_place_of_the_tasks_rates(tmp_path, capsys):
    for arguments, rates in (([], {"gain": 2e-4, "threshold": 4e-4}), (["--agent.rate", "0.5"], None)):
        with pytest.raises(SystemExit) as end:
            main(["train", "arm-recruitment", *arguments, "--check"])
        assert not end.value.code
        assert tomllib.loads(capsys.readouterr().out)["agent"].get("rates") == rates


def test_a_run_whose_setting_is_none_goes_on_and_is_repeated_by_its_own_configuration(tmp_path, capsys):
    first, again = tmp_path / "first", tmp_path / "again"
    arguments = ["train", "arm-recruitment", "--agent.rates", "None", "--agent.rate", "1e-4", "--steps", "90"]
    assert main([*arguments, "--out", str(first)]) == 0
    assert main(["train", "--resume", str(first), "--steps", "120"]) == 0
    assert main(["train", "--config", str(first / "config.toml"), "--out", str(again)]) == 0
    capsys.readouterr()
    configurations = [tomllib.loads((path / "config.toml").read_text()) for path in (first, again)]
    assert all("rates" not in found["agent"] and found["agent"]["rate"] == 1e-4 for found in configurations)
    policies = [np.asarray(load(path).policies.gain) for path in (first, again)]
    np.testing.assert_array_equal(*policies)
