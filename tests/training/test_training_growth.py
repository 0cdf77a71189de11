"""Growing learners in training: resumed bit for bit, each seed by its own, recorded, in plain values, and refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from training_examples import assert_differ, assert_same, assert_same_run, columns, learner

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.learning import Agent, Clock, Growth, Plateau, Visited
from motorgrad.policies import growing
from motorgrad.training import agent_for

TASK = mg.make("linear-recruitment", units=6)
QUICK = {
    "policy": "growing",
    "growth.shrink": 0.9,
    "learning_rate": {"centre": 1e-2, "log_width": 1e-2},
    "metric": None,
}
RULES = {
    "clock": {**QUICK, "growth": "clock", "growth.criterion.interval": 40},
    "plateau": {**QUICK, "growth": "plateau", "growth.criterion.window": 60, "growth.placement": "visited"},
}


def go(rule, out=None, steps=240, seeds=(3, 0, 8), **options):
    return mg.train(TASK, RULES[rule], steps, list(seeds), out, window=20, progress=False, **options)


SOME = [pytest.param(rule, marks=() if rule == "clock" else pytest.mark.slow) for rule in RULES]
every_rule = pytest.mark.parametrize("rule", SOME)


@every_rule
def test_a_growing_run_is_resumed_bit_for_bit(rule, tmp_path):
    whole = go(rule, tmp_path / "whole")
    go(rule, tmp_path / "parts", steps=130)
    parts = go(rule, tmp_path / "parts")
    assert_same_run(mg.load(parts.path), mg.load(whole.path))
    assert_differ(whole.policies, go(rule, steps=130).policies)
    np.testing.assert_array_equal(mg.load(whole.path).policies.active, whole.policies.active)


@pytest.mark.slow
@every_rule
def test_seeds_grow_each_by_its_own_rewards(rule):
    together = go(rule)
    for row, seed in enumerate((3, 0, 8)):
        alone = go(rule, seeds=[seed])
        np.testing.assert_array_equal(together.policies.active[row], alone.policies.active[0])
        # another number of lanes may round differently
        for mine, own in zip(jax.tree.leaves(together.policies), jax.tree.leaves(alone.policies), strict=True):
            np.testing.assert_allclose(mine[row], own[0], rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_the_metrics_say_how_many_units_there_are():
    run = go("clock")
    units = columns(run.metrics)["units"].reshape(-1, 3)
    np.testing.assert_array_equal(units, np.repeat([1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 6], 3).reshape(-1, 3))
    # a unit shrinks for 19 decisions; the last came at 200
    adding = columns(run.metrics)["adding"].reshape(-1, 3)
    np.testing.assert_array_equal(adding, np.repeat([0, 1] * 5 + [0, 0], 3).reshape(-1, 3))
    assert run.policies.active.all()
    assert not {"units", "adding"} & set(go_plain().metrics.column_names)


def go_plain():
    return mg.train(TASK, None, 20, 1, window=20, progress=False)


@pytest.mark.slow
def test_one_chunk_or_many_are_the_same():
    steppers = [learner(TASK, [5, 2], **RULES["plateau"]) for _ in range(2)]
    steppers[0].advance(300)
    for part in (1, 137, 62, 100):
        steppers[1].advance(part)
    assert_same(steppers[0].state, steppers[1].state)


@pytest.mark.ci
def test_it_grows_on_a_body():
    task = mg.make("hopper")
    run = mg.train(task, RULES["clock"], 45, 2, window=15, progress=False)
    np.testing.assert_array_equal(columns(run.metrics)["units"].reshape(-1, 2), [[1, 1], [1, 1], [2, 2]])
    # 19 decisions of the first unit from the start, and of the second from 40 on
    np.testing.assert_array_equal(run.curve("adding")[1], [[1, 0, 1]] * 2)
    history = run.policies_at()
    np.testing.assert_array_equal(history.active.sum(-1).T, run.curve("units")[1])
    np.testing.assert_array_equal(history.pool.centre[-1], run.policies.pool.centre)


def test_settings_make_the_schedule():
    rule = {"growth.criterion.patience": 2, "growth.criterion.confidence": 0.9, "growth.units": 4, "growth.boost": 3.0}
    agent = agent_for(TASK, {**RULES["plateau"], **rule})
    wanted = Growth(Plateau(60, 0.9, 2), 4, 0.5, Visited(), shrink=0.9, boost=3.0)
    assert agent.growth == wanted
    assert agent_for(TASK, RULES["clock"]).growth == Growth(Clock(40), shrink=0.9)
    assert agent_for(TASK).growth is None


def test_a_schedule_belongs_to_what_identifies_a_run(tmp_path):
    go("clock", tmp_path, steps=20)
    other = {**RULES["clock"], "growth.criterion.interval": 50}
    with pytest.raises(mg.training.RunDirectoryError, match=r"growth\.criterion\.interval was 40 and is now 50"):
        mg.train(TASK, other, 20, [3, 0, 8], tmp_path, window=20, progress=False)


@pytest.mark.ci
def test_a_grown_run_is_taken_up_with_the_units_it_has():
    first = go("clock", steps=60)
    again = go("clock", steps=20, initial=first.policies)
    # two were there, and one more is added at once
    np.testing.assert_array_equal(np.sum(again.policies.active, 1), 3)
    np.testing.assert_array_equal(again.initial.pool.centre[:, :2], first.policies.pool.centre[:, :2])


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"growth": "clock"}, "'Motoneurons': must be a Masked pool"),
        ({"policy": "growing", "growth": None}, "agent.growth = None: must be set, such as 'clock', for the policy"),
        ({**QUICK, "growth": "clok"}, "growth 'clok': did you mean 'clock'"),
        (
            {**RULES["clock"], "growth.criterion.interval": 10},
            "growth.criterion.interval = 10: must be at least the 19",
        ),
        ({**RULES["clock"], "growth.width": 0.0}, "growth.width = 0.0: must be a finite number above 0"),
        ({**RULES["clock"], "growth.cutoff": -1.0}, "growth.cutoff = -1.0: must be a finite number above 0"),
        ({**RULES["clock"], "growth.units": 0}, "growth.units = 0: must be an integer of at least 1"),
        (
            {**RULES["plateau"], "growth.criterion.window": 5},
            "growth.criterion.window = 5: must be an integer from 40",
        ),
        ({**RULES["clock"], "update_every": "never"}, "must be None where parameters never move"),
    ],
)
def test_impossible_schedules_are_refused_by_the_settings_names(changes, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        agent_for(TASK, changes)
    assert names in str(error.value)


def test_a_pool_smaller_than_the_schedule_needs_is_refused_in_one_line_at_the_command_line(capsys):
    asked = ["--agent.policy", "growing", "--agent.growth", "clock", "--task.units", "6", "--agent.growth.units", "7"]
    assert main(["train", "linear-recruitment", "--check", *asked]) == 2
    said = capsys.readouterr().err
    assert said.strip() == "motorgrad train: growth.units = 7: must be at most the pool's, 6"


def test_a_growing_hierarchy_is_refused():
    from motorgrad.policies import Gated, Hyperplanes

    with pytest.raises(ValueError, match="'Gated': must be a Masked pool"):
        Agent(Gated(Hyperplanes([[1.0]], jnp.zeros(1)), [growing(1, 2)]), growth=Growth()).init(jax.random.key(0))
