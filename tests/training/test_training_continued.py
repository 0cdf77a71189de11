"""Trainings that start from a run: its statistics go on, what has changed is named, and its files are whole."""

# pyright: reportOptionalMemberAccess=false
# (A run that was learned here has an interface.)

import functools
import json

import jax
import numpy as np
import pytest
from training_examples import assert_same
from whole_examples import REACH, agent_of, learned, task_of, trained

import motorgrad as mg
from motorgrad.policies import Interface, with_interface
from motorgrad.tasks import compose
from motorgrad.training import RunWarning, stepper_for
from motorgrad.training.store._checkpoint import load as load_checkpoint
from motorgrad.training.store._checkpoint import save as save_checkpoint


def counts(policies):
    return np.asarray(policies.interface.statistics.mean.count)


def test_a_training_that_starts_from_a_run_goes_on_with_its_statistics(tmp_path):
    run = learned("arm")
    again = trained("arm", steps=12, out=tmp_path, initial=run.policies)
    np.testing.assert_array_equal(counts(again.initial), counts(run.policies))
    np.testing.assert_array_equal(counts(again.policies), counts(run.policies) + 13)  # and the first look
    stored = mg.load(tmp_path)
    assert_same(stored.initial, again.initial)
    assert_same(stored.policies, again.policies)
    assert_same(mg.training.given_initial(tmp_path), again.initial)


def test_what_starts_from_a_run_starts_at_its_level():
    """Steps of nearly 0 show the level: that of the run itself, on the same numbers, and another without its scale."""
    agent = mg.Agent(agent_of("arm").policy, mg.learning.olgarb(decay=0.9), mg.learning.SGD(1e-12))
    run = trained("arm", agent=agent, steps=400, window=40)
    more = {"agent": agent, "steps": 40, "window": 40}
    with_scale = trained("arm", initial=run, **more).curve()[1][:, 0]
    without = trained("arm", initial=with_interface(run.policies, None), **more).curve()[1][:, 0]
    stepper = stepper_for(task_of("arm"), agent, [3, 5], "sample", threads=1, initial=run.policies)
    stepper.advance(40)
    level = stepper.harvest()["reward"] / 40
    np.testing.assert_allclose(with_scale, level, rtol=0.02)
    assert np.abs(without / level - 1).max() > 0.05


def test_several_environments_go_on_with_the_statistics_of_the_run():
    run = learned("arm")
    again = trained("arm", steps=12, initial=run, envs=2)
    np.testing.assert_array_equal(counts(again.policies), counts(run.policies) + 14)  # and two first looks


CHANGED = {
    "the time limit": ({"time_limit": 0.5}, None),
    "names": (
        {"observe": ["joint-positions", "joint-velocities", "target"]},
        "without 'target error x', 'target error y', 'target error z', with 'target ",
    ),
    "number": (
        {"observe": ["joint-positions", "target-error"]},
        "5 observations in place of 7, without 'shoulder velocity'",
    ),
    "order": (
        {"observe": ["joint-velocities", "joint-positions", "target-error"]},
        "other observations, in another order",
    ),
    "scale": ({"scaling": "none"}, r"another scale of '.*' and 1 more: \(0, 1\) in place of running statistics"),
    "groups": ({"groups": ["*flexor", "*extensor"]}, "2 actions in place of 6, without "),
    "kind": ({"actions": "binary"}, "binary actions in place of continuous ones"),
}


@pytest.mark.parametrize("name", CHANGED)
def test_a_changed_task_takes_a_policy_with_the_same_numbers_and_says_which_differ(name):
    changes, message = CHANGED[name]
    task = compose("arm6", **{"time_limit": 1.0, **REACH, **changes})
    own = learned("arm").policies.interface
    if message is None:
        assert task.interface().differences(own) == []
        return
    said = rf"initial, on the task 'composed': must have the observations .*{message}"
    with pytest.raises(ValueError, match=said):
        mg.train(task, agent_of("arm"), 12, progress=False, initial=learned("arm"))


def test_a_run_of_a_tasks_own_learner_goes_on_with_that_in_one_call():
    run = mg.train("linear-recruitment", {"learning_rate": 0.03}, 40, 2, progress=False)
    changed = mg.make("linear-recruitment", size_ratio=3.0)
    again = mg.train(changed, steps=40, progress=False, initial=run)
    assert again.seeds == run.seeds
    assert again.config["agent"] == run.config["agent"]
    assert_same(again.initial, run.policies)
    swept = mg.train("linear-recruitment", None, 20, sweep={"learning_rate": [0.1, 0.2]}, progress=False)
    with pytest.raises(ValueError, match=r"initial = .*: must be a run of one setting: run\.split\(\)\[0\]"):
        mg.train("linear-recruitment", steps=20, progress=False, initial=swept)


class Remembers(mg.tasks.Chain):
    """A task that keeps something for itself, and does not say what a policy sees by it."""

    def freeze(self, memory):
        return memory


def test_a_task_that_scales_in_a_way_of_its_own_is_refused_by_name():
    with pytest.warns(RunWarning, match=r"task 'chain' = 'freeze': must be with `sense` and `observation_code`"):
        run = mg.train(Remembers(), steps=20, progress=False)
    with pytest.warns(RunWarning, match=r"policies are without their interface.*: task 'chain'"):
        policy = run.policy()
    with pytest.raises(ValueError, match="Softmax without an interface"):
        policy.act(np.zeros(6))


# -- files


def test_a_run_of_an_earlier_version_is_read_and_gets_its_interface_from_its_task(tmp_path):
    stored = trained("arm", steps=12, out=tmp_path)
    file = tmp_path / "checkpoint" / "initial.policies"
    arrays, about = load_checkpoint(file)
    learner = {name: value for name, value in about["learner"].items() if name != "interface"}
    mark = save_checkpoint(file, arrays, {"decision": 0, "learner": learner})
    newest = max((tmp_path / "checkpoint").glob("*.state"))
    arrays, facts = load_checkpoint(newest)
    kept = {name: value for name, value in facts.items() if name not in ("format", "names", "checksum")}
    save_checkpoint(newest, arrays, {**kept, "initial": mark})
    old = mg.load(tmp_path)
    assert old.policies.interface is None
    assert_same(old.policy(5).interface, stored.policy(5).interface)


STRANGE = [
    (("observations", "divisor", 0), 0.0, r"interface\.observations\.divisor = .*: must be numbers other than 0"),
    (("observations", "offset", 0), float("nan"), r"offset = .*: must be finite numbers"),
    (("observations", "names"), ["x"] * 3, r"offset = .*: must be numbers of shape \(3,\)"),
    (("observations", "names", 0), "x" * 2000, r"names = .*: must be names of at most"),
    (("observations", "running"), None, r"running = None: must be true or false, 7 times"),
    (("observations", "shape"), [8], r"shape = \[8\]: must be of 7 numbers"),
    (("actions", "form"), "eval", r"actions\.form"),
    (("actions", "size"), 2**60, r"actions\.size"),
    (("actions", "dtype"), "O", r"actions\.dtype = 'O': must be a type of numbers"),
    (("actions", "high"), ["float32", ["1"]], r"actions\.high = .*: must be "),
    (("actions", "shape"), [2**70], r"actions\.shape"),
    (("actions", "matrix"), ["float32", [[1.0]]], r"actions\.matrix = .*: must be null for the form 'clip'"),
    (("actions",), None, r"interface\.actions"),
    (("period",), -1.0, r"interface\.period = -1\.0: must be a finite number > 0"),
]


@pytest.mark.parametrize(("place", "value", "message"), STRANGE)
def test_a_strangers_interface_is_refused_by_name(place, value, message):
    own = learned("arm").policies.interface
    table = json.loads(json.dumps(own.table()))
    assert Interface.of_table(table).with_statistics(own.statistics).table() == own.table()
    *outer, last = place
    functools.reduce(lambda part, key: part[key], outer, table)[last] = value
    with pytest.raises(ValueError, match=message):
        Interface.of_table(table)


@pytest.mark.parametrize("code", ["choice", "count", "each", "antagonists", "continuous"])
def test_every_code_is_stored_whole_and_traced_as_it_is_computed(code):
    space = {"choice": "MountainCar-v0", "count": "MountainCar-v0"}.get(code, "Pendulum-v1")
    own = mg.tasks.from_gymnasium(space, code=code).interface()
    again = Interface.of_table(json.loads(json.dumps(own.table())))
    assert again == own
    size = own.actions.size
    rng = np.random.default_rng(2)
    given = {
        "discrete": np.arange(size, dtype=np.int32),
        "binary": rng.integers(0, 2, (8, size)).astype(np.float32),
        "continuous": rng.normal(scale=3, size=(8, size)).astype(np.float32),
    }[own.actions.kind]
    traced = np.asarray(jax.jit(jax.vmap(again.decode))(given))
    np.testing.assert_array_equal(traced.reshape(len(given), -1), own.actions.native(given).reshape(len(given), -1))
