"""Settings as tables: what is built is what was meant, and whatever is refused is refused by name."""

import copy
import dataclasses
import math
import tomllib

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorgrad.bodies import Hopper as HopperBody
from motorgrad.bodies import Muscle
from motorgrad.cli import main
from motorgrad.learning import (
    SGD,
    Adam,
    Agent,
    Annealed,
    Estimator,
    FisherMetric,
    Growth,
    Learner,
    LinearCritic,
    Window,
)
from motorgrad.schema import build, declared_at, fields_of, numbers_of, table, with_number
from motorgrad.tasks import TASKS, HexapodPrimitive, make
from motorgrad.training import agent_for, agent_from_table, agent_table, load, stepper_for

PARTS = {
    "estimator": Estimator,
    "sgd": SGD,
    "adam": Adam,
    "critic": LinearCritic,
    "growth": Growth,
    "fisher": FisherMetric,
}
CLASSES = {**TASKS, **PARTS, "body": HopperBody, "muscle": Muscle}

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


@pytest.mark.ci
@pytest.mark.representatives("composed", "estimator", "hopper")  # terms, a part, a body and its muscles
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
        again = {key: value for key, value in table(made).items() if key != "kind"}
        assert build(cls, again, name) == made
        return
    # what is named was given, or was left out
    assert any(key in refused for key in [*drawn, *keys])


def test_an_unknown_actuator_is_refused_with_the_name_of_its_setting():
    with pytest.raises(ValueError, match=r"composed\.groups: unknown actuator 'a': known are biarticular"):
        build(CLASSES["composed"], {"groups": ["a"]}, "composed")


@pytest.mark.parametrize("name", TASKS)
def test_a_task_survives_its_own_table_in_toml(name):
    task = TASKS[name]()
    assert build(TASKS[name], tomllib.loads(tomli_w.dumps(table(task)))) == task


def test_a_setting_that_is_turned_off_survives_in_toml():
    cls = TASKS["hexapod-proprioception"]
    assert cls().time_limit is not None
    assert build(cls, tomllib.loads(tomli_w.dumps(table(cls(time_limit=None))))) == cls(time_limit=None)


LATER = dict.fromkeys(("parity", "t-maze"), pytest.mark.ci)  # their initial policies take long to make


@pytest.mark.parametrize("name", [pytest.param(name, marks=LATER.get(name, ())) for name in TASKS])
def test_a_tasks_learner_is_made_of_settings_that_exist(name):
    task = make(name)
    agent = agent_for(task)
    assert agent == agent_for(task, {**(task.learner or {})})
    assert agent_from_table(task, agent_table(agent)) == agent
    assert agent_from_table(task, tomllib.loads(tomli_w.dumps(agent_table(agent)))) == agent


def test_changes_go_through_the_table():
    task = make("hopper", penalty=0.3, body={"knee_range": [50, 140], "extra_muscles": []})
    assert make("hopper", **table(task)) == task
    assert task.body.knee_range == (50.0, 140.0)


REFUSED = [
    ({"polcy": "softmax"}, "unknown setting of agent 'polcy': did you mean 'policy'"),
    ({"policy": "softmx"}, "unknown agent.policy 'softmx': did you mean 'softmax'"),
    ({"estimator": "olgarp"}, "'olgarp': did you mean 'olgarb'"),
    ({"trace": "windows"}, "'windows': did you mean 'window'"),
    ({"baseline": "means"}, "'means': did you mean 'mean'"),
    ({"optimizer": "adams"}, "'adams': did you mean 'adam'"),
    ({"reduction": "summ"}, "'summ': did you mean 'sum'"),
    ({"decay": 1.5}, r"decay = 1.5: must be in \[0, 1\]"),
    ({"decay": -0.1}, "decay = -0.1"),
    ({"decay": "0.9"}, "agent.estimator.trace.decay = '0.9': must be a finite number"),
    ({"decay": math.nan}, "agent.estimator.trace.decay = nan: must be a finite number"),
    ({"learning_rate": 10**400}, "agent.optimizer.learning_rate = 1.*: must be a"),
    ({"learning_rate": -1.0}, "learning_rate = -1.0"),
    ({"learning_rate": {"weights": -1.0}}, "weights = -1.0"),
    ({"learning_rate": {"weights": "fast"}}, "agent.optimizer.learning_rate.weights = 'fast'"),
    ({"learning_rate": "fast"}, "agent.optimizer.learning_rate = 'fast'"),
    ({"update_every": 0}, "update_every = 0"),
    ({"update_every": True}, "'?True'?"),
    ({"update_every": "always"}, "'always'"),
    ({"discount": 0.0}, "discount = 0.0"),
    ({"discount": 1.5}, "discount = 1.5"),
    ({"trace": "window", "trace.length": 0}, "length = 0"),
    ({"trace": "window", "trace.length": 2.5}, "agent.estimator.trace.length = 2.5: must be an integer"),
    ({"trace": "lagged-gaussian", "trace.width": 0.0}, "width = 0.0"),
    ({"baseline": "fixed-step", "baseline.rate": 2.0}, "rate = 2.0"),
    ({"units": 0}, "units|outputs"),
]


@pytest.mark.parametrize(("changes", "named"), REFUSED, ids=[str(changes)[:40] for changes, _ in REFUSED])
def test_impossible_learners_are_refused_by_name(changes, named):
    task = make("hopper")
    with pytest.raises(ValueError, match=named):
        stepper_for(task, agent_for(task, changes), [0])


@pytest.mark.parametrize("name", ["units", "discount", "baseline", "entropy", "weight_decay"])
def test_what_may_be_absent_is_taken_away_by_none_or_its_word(name):
    for value in (None, "none"):
        agent = agent_for("hopper", {name: value})
        assert agent == agent_for("hopper", {name: None})
    assert agent_for("hopper", units=None).policy.units is None


@pytest.mark.parametrize("name", Estimator.presets)
def test_a_named_estimator_stands_for_its_parts_unless_they_are_given(name):
    parts = Estimator.presets[name]
    plain = agent_for("hopper", estimator=name)
    assert plain == agent_for("hopper", {f"estimator.{part}": value for part, value in parts.items()})
    assert plain.estimator.trace == agent_for("hopper").estimator.trace  # the task's own
    changed = agent_for("hopper", estimator=name, update_every=7, baseline="fixed-step").estimator
    assert (changed.update_every, type(changed.baseline).__name__) == (7, "FixedStep")


def test_short_names_are_few_and_the_same_in_every_place():
    for kind in Learner.kinds().values():
        assert len(kind.aliases) <= 13
        for short, path in kind.aliases.items():
            assert short not in fields_of(kind)
            assert path.rpartition(".")[2] == short
    for short, whole in (("decay", "estimator.trace.decay"), ("trace.decay", "estimator.trace.decay")):
        assert agent_for("hopper", {short: 0.5}) == agent_for("hopper", {whole: 0.5})
    nested = agent_for("hopper", estimator={"trace": {"decay": 0.5}})
    assert nested == agent_for("hopper", decay=0.5)


def test_a_part_is_given_itself_by_its_kind_or_as_a_table():
    wanted = agent_for("hopper", {"trace": Window(7)})
    for changes in (
        {"trace": {"kind": "window", "length": 7}},
        {"trace": "window", "trace.length": 7},
        {"estimator.trace.kind": "window", "estimator.trace.length": 7},
        {"estimator": {"trace": {"kind": "window", "length": 7}}},
        {"trace": Window(3), "trace.length": 7},
    ):
        assert agent_for("hopper", changes) == wanted


def test_a_table_that_others_change_stays_as_it_was_given():
    given = {"estimator": {"kind": "actor-critic", "trace": {"kind": "exponential"}}, "decay": 0.5}
    before = copy.deepcopy(given)
    assert agent_for("chain", given).estimator.trace.decay == 0.5
    assert given == before


def test_a_part_of_another_kind_starts_from_its_own_defaults():
    assert agent_for("hopper", optimizer="adam").optimizer == Adam()
    changed = agent_for("hopper", optimizer={"learning_rate": 0.1})
    assert changed.optimizer == SGD(0.1)


def test_what_must_be_given_is_asked_for_by_name():
    with pytest.raises(ValueError, match=r"body\.extra_muscles\[0\]\.group: must be given"):
        build(HopperBody, {"extra_muscles": [{"name": "helper"}]}, "body")


@pytest.mark.parametrize("one", ["learning_rate", "damping", "weight_decay"])
def test_one_number_for_all_takes_the_place_of_a_number_by_group(one):
    groups = {"gain": 0.1, "threshold": 0.2}
    part, path = ("metric", "metric.damping") if one == "damping" else ("optimizer", f"optimizer.{one}")
    by_group = agent_for("arm-recruitment", {"metric": "fisher", one: groups})
    assert getattr(getattr(by_group, part), one) == groups
    single = agent_for("arm-recruitment", {"metric": "fisher", one: 0.5})
    assert getattr(getattr(single, part), one) == 0.5
    assert agent_for("arm-recruitment", {"metric": "fisher", path: 0.5}) == single


def test_the_number_of_one_group_is_changed_by_its_path():
    changed = agent_for("arm-recruitment", {"learning_rate.gain": 0.5})
    assert changed.optimizer.learning_rate == {"gain": 0.5, "threshold": 4e-4}


@pytest.mark.parametrize(
    "change",
    [
        {"learning_rate.movement.weights": 0.5},
        {"optimizer.learning_rate": {**HexapodPrimitive.learner["learning_rate"], "movement": {"weights": 0.5}}},
    ],
)
def test_the_number_of_one_pool_is_changed_by_its_path(change):
    usual = HexapodPrimitive.learner["learning_rate"]
    agent = agent_for("hexapod-primitive", change)
    path = "optimizer.learning_rate.movement.weights"
    assert agent.optimizer.learning_rate == {**usual, "movement.weights": 0.5}
    assert numbers_of(agent)[path] == 0.5
    assert declared_at(agent, path) == declared_at(agent, "optimizer.learning_rate")
    assert with_number(agent, path, 0.25).optimizer.learning_rate == {**usual, "movement.weights": 0.25}
    again = agent_from_table(make("hexapod-primitive"), tomllib.loads(tomli_w.dumps(agent_table(agent))))
    assert again.optimizer.learning_rate == agent.optimizer.learning_rate
    with pytest.raises(ValueError, match=r"unknown number 'optimizer\.learning_rate\.movement\.wieghts'"):
        declared_at(agent, "optimizer.learning_rate.movement.wieghts")


def test_a_flag_of_a_part_is_turned_off_and_on(capsys):
    network = ("--agent.policy.network", "perceptron")
    for word, value in (("--agent.policy.network.no-layer-norm", False), ("--agent.policy.network.layer-norm", True)):
        with pytest.raises(SystemExit, match="0"):
            main(["train", "hopper", "--check", *network, word, "--steps", "10"])
        assert tomllib.loads(capsys.readouterr().out)["agent"]["policy"]["network"]["layer_norm"] is value
    assert main(["train", "hopper", "--check", "--steps", "--seeds", "2"]) == 2
    assert "steps = 'nothing': must be followed by a value" in capsys.readouterr().err
    assert main(["train", "hopper", "--check", "--steps", "10", "--steps", "20"]) == 2
    assert "--steps = '20': must be given once" in capsys.readouterr().err


def test_the_number_of_one_pool_is_an_option(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["train", "hexapod-primitive", "--agent.learning-rate.movement.weights", "0.5", "--check"])
    rates = tomllib.loads(capsys.readouterr().out)["agent"]["optimizer"]["learning_rate"]
    assert rates == {**HexapodPrimitive.learner["learning_rate"], "movement.weights": 0.5}


def test_an_annealed_rate_takes_the_place_of_numbers_by_group_and_is_changed_by_its_paths(capsys):
    falling = {"kind": "annealed", "start": 0.1, "end": 0.01, "steps": 50}
    changed = agent_for("arm-recruitment", {"learning_rate": falling})
    assert changed.optimizer.learning_rate == Annealed(0.1, 0.01, 50)
    further = build(Agent, {"optimizer": {"learning_rate": {"start": 0.2}}}, "agent", changed)
    assert further.optimizer.learning_rate == Annealed(0.2, 0.01, 50)
    words = ["annealed", *(w for name in ("start", "end", "steps") for w in (f"@.{name}", str(falling[name])))]
    rate = "--agent.optimizer.learning-rate"
    with pytest.raises(SystemExit, match="0"):
        main(["train", "arm-recruitment", rate, *(word.replace("@", rate) for word in words), "--check"])
    assert tomllib.loads(capsys.readouterr().out)["agent"]["optimizer"]["learning_rate"] == falling


@pytest.mark.ci
def test_kinds_of_parts_go_with_options_of_the_task(capsys):
    options = ["--task.penalty", "0.2", "--agent.policy", "gaussians", "--agent.baseline", "fixed-step"]
    with pytest.raises(SystemExit, match="0"):
        main(["train", "hopper", *options, "--agent.optimizer", "adam", "--check"])
    found = tomllib.loads(capsys.readouterr().out)
    kinds = [found["agent"][name]["kind"] for name in ("policy", "optimizer")]
    assert (found["task"]["penalty"], *kinds) == (0.2, "gaussians", "adam")
    assert found["agent"]["estimator"]["baseline"]["kind"] == "fixed-step"


@pytest.mark.ci
def test_the_commands_rate_for_all_takes_the_place_of_the_tasks_rates(tmp_path, capsys):
    for arguments, rates in (
        ([], {"gain": 2e-4, "threshold": 4e-4}),
        (["--agent.learning-rate", "0.5"], 0.5),
        (["--agent.learning-rate", "gain", "0.1", "threshold", "0.2"], {"gain": 0.1, "threshold": 0.2}),
        (["--agent.learning-rate.gain", "0.1"], {"gain": 0.1, "threshold": 4e-4}),
    ):
        with pytest.raises(SystemExit) as end:
            main(["train", "arm-recruitment", *arguments, "--check"])
        assert not end.value.code
        assert tomllib.loads(capsys.readouterr().out)["agent"]["optimizer"]["learning_rate"] == rates


@pytest.mark.ci
def test_a_run_with_one_number_for_all_goes_on_and_is_repeated_by_its_own_configuration(tmp_path, capsys):
    first, again = tmp_path / "first", tmp_path / "again"
    arguments = ["train", "arm-recruitment", "--agent.learning-rate", "1e-4", "--steps", "90"]
    assert main([*arguments, "--out", str(first)]) == 0
    assert main(["train", "--resume", str(first), "--steps", "120"]) == 0
    assert main(["train", "--config", str(first / "config.toml"), "--out", str(again)]) == 0
    capsys.readouterr()
    configurations = [tomllib.loads((path / "config.toml").read_text()) for path in (first, again)]
    assert all(found["agent"]["optimizer"]["learning_rate"] == 1e-4 for found in configurations)
    policies = [np.asarray(load(path).policies.gain) for path in (first, again)]
    np.testing.assert_array_equal(*policies)


def test_a_kind_that_is_no_name_is_refused():
    with pytest.raises(ValueError, match=r"agent\.estimator\.trace\.kind = \[\]: must be the name of a kind"):
        agent_for(make("three-state"), {"estimator": {"trace": {"kind": []}}})
