"""Seeds that begin from policies that were given: exactly these, resumed exactly, and others refused by name."""

import shutil
import tomllib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from training_examples import assert_differ, assert_same, assert_same_run, columns

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.policies import Hyperplanes, Motoneurons, Softmax, grow, with_interface
from motorgrad.training import RunDirectoryError, agent_for, fingerprint, given_initial

TASK = mg.make("linear-recruitment", units=3)
SEEDS = [4, 1]


def pools(units=3, salt=0):
    rng = np.random.default_rng(salt)
    return Motoneurons(rng.random(3 * units)[:units], np.zeros(units)), [
        Motoneurons(rng.random(units), rng.normal(size=units)) for _ in SEEDS
    ]


def stack(policies):
    return jax.tree.map(lambda *leaves: np.stack(leaves), *policies)


GIVEN = with_interface(stack(pools()[1]), TASK.interface())


def go(initial=GIVEN, out=None, steps=60, agent=None, task=TASK, window=20, seeds=SEEDS, **options):
    agent = agent_for(task, learning_rate=0.01) if agent is None else agent
    return mg.train(
        task, agent, steps, seeds, out, window=window, progress=False, threads=1, initial=initial, **options
    )


def test_each_seed_begins_from_its_own_policy():
    run = go()
    assert_same(run.initial, GIVEN)
    for row, seed in enumerate(SEEDS):
        own = jax.tree.map(lambda leaf, row=row: jnp.asarray(leaf[row]), GIVEN)
        alike = go(None, agent=mg.Agent(own, *_parts()))  # all seeds from this one; as many lanes, for the same bits
        assert alike.seeds[row] == seed
        found, wanted = (columns(each.metrics)["parameters"][row::2] for each in (run, alike))
        np.testing.assert_array_equal(found, wanted)
    assert_differ(run.policies, GIVEN)


def _parts():
    agent = agent_for(TASK, learning_rate=0.01)
    return agent.estimator, agent.optimizer


@pytest.mark.slow
def test_the_agents_own_beginnings_given_back_to_it_change_nothing(tmp_path):
    for task, name in ((TASK, "world"), (mg.make("hopper"), "body")):
        agent = agent_for(task)
        first = go(None, tmp_path / name, task=task, agent=agent)
        again = go(first.initial, task=task, agent=agent)
        assert_same(columns(again.metrics), columns(first.metrics))
        assert_same(again.policies, first.policies)
        assert again.config["run"] != first.config["run"]


@pytest.mark.ci
def test_bodies_begin_from_what_they_are_given_too():
    task = mg.make("hopper")
    first = go(None, task=task, agent=None)
    moved = jax.tree.map(
        lambda leaf: leaf + np.array([0.5, -0.5], np.float32).reshape(2, *[1] * (leaf.ndim - 1)), first.initial
    )
    run = go(moved, task=task)
    assert_same(run.initial, moved)
    assert_differ(run.policies, first.policies)


def test_a_rule_that_keeps_the_parameters_begins_from_the_given_ones():
    rule = optax.chain(optax.sgd(0.01), _distance_from_start())
    start = pools()[0]
    run = go(agent=mg.Agent(start, agent_for(TASK).estimator, rule), steps=1)
    # the rule pulls to where it began; had it begun elsewhere, one step would lead far away
    np.testing.assert_allclose(run.policies.threshold, GIVEN.threshold, atol=0.2)


def _distance_from_start():
    """A rule that moves half of the way back to the parameters that it was started with."""
    return optax.GradientTransformation(
        lambda params: params,
        lambda updates, state, params: (
            jax.tree.map(lambda u, s, p: u + 0.5 * (s - p), updates, state, params),
            state,
        ),
    )


@pytest.mark.ci
def test_the_metric_of_the_natural_gradient_begins_as_ever():
    run = go(agent=agent_for(TASK, metric="fisher", damping=0.1))
    assert np.isfinite(columns(run.metrics)["parameters"]).all()
    assert_differ(run.policies, go().policies)


@pytest.mark.ci
def test_learning_in_two_parts_of_grown_pools():
    small = mg.make("linear-recruitment", units=2)
    first = mg.train(small, None, 40, SEEDS, progress=False)
    grown = jax.vmap(lambda pool: grow(pool, Motoneurons(jnp.array([0.5]), jnp.zeros(1))))(first.policies)
    second = go(grown)
    np.testing.assert_array_equal(second.initial.threshold[:, :2], first.policies.threshold)
    np.testing.assert_array_equal(second.initial.gain[:, 2], 0)


def test_a_run_goes_on_from_its_directory_alone_as_if_made_in_one_go(tmp_path):
    go(out=tmp_path / "parts", steps=40)
    assert_same(given_initial(tmp_path / "parts"), GIVEN)
    parts = mg.resume(tmp_path / "parts", 100, progress=False)
    whole = go(out=tmp_path / "whole", steps=100)
    assert_same_run(mg.load(parts.path), mg.load(whole.path))
    assert tomllib.loads((tmp_path / "parts" / "config.toml").read_text())["run"]["initial"] == fingerprint(
        jax.tree.map(jnp.asarray, GIVEN)
    )
    assert_same(mg.load(tmp_path / "parts").initial, GIVEN)


@pytest.mark.ci
def test_the_command_line_goes_on_with_such_a_run(tmp_path):
    go(out=tmp_path / "run", steps=40)
    whole = go(out=tmp_path / "whole", steps=100)
    assert main(["train", "--resume", str(tmp_path / "run"), "--steps", "100"]) == 0
    assert_same_run(mg.load(tmp_path / "run"), mg.load(whole.path))


def test_the_command_line_makes_no_such_run_of_settings_alone(tmp_path, capsys):
    go(out=tmp_path / "run", steps=40)
    assert main(["train", "--config", str(tmp_path / "run" / "config.toml"), "--out", str(tmp_path / "other")]) == 2
    said = capsys.readouterr().err
    assert "run.initial: this run started from given policies" in said
    assert len(said.strip().splitlines()) == 1
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("other", ["other policies", "none"])
def test_other_beginnings_are_refused_by_name(other, tmp_path):
    run = go(out=tmp_path)
    given = None if other == "none" else stack(pools(salt=1)[1])
    with pytest.raises(RunDirectoryError, match=r"another configuration: run\.initial was '\w+' and is now "):
        go(given, tmp_path)
    assert_same_run(mg.load(tmp_path), run)


def test_a_run_of_the_agents_own_beginnings_refuses_given_ones(tmp_path):
    go(None, tmp_path)
    with pytest.raises(RunDirectoryError, match=r"run\.initial was None and is now '\w+'"):
        go(out=tmp_path)


def test_lost_beginnings_are_asked_for(tmp_path):
    go(out=tmp_path / "run", steps=40)
    (tmp_path / "run" / "checkpoint" / "initial.policies").unlink()
    with pytest.raises(RunDirectoryError, match=r"initial\.policies is missing: give the initial policies again"):
        mg.resume(tmp_path / "run", 60, progress=False)
    # killed after the configuration was written, and before anything else was
    shutil.rmtree(tmp_path / "run" / "checkpoint")
    shutil.rmtree(tmp_path / "run" / "metrics")
    with pytest.raises(RunDirectoryError, match=r"run\.initial was"):
        go(stack(pools(salt=1)[1]), tmp_path / "run")
    assert_same(columns(go(out=tmp_path / "run").metrics), columns(go().metrics))


def test_an_agent_made_by_hand_goes_on_from_given_policies(tmp_path):
    agent = mg.Agent(pools()[0], *_parts())
    for name, legs in (("parts", (40, 100)), ("whole", (100,))):
        for steps in legs:
            go(out=tmp_path / name, agent=agent, steps=steps)
    assert_same_run(mg.load(tmp_path / "parts"), mg.load(tmp_path / "whole"))
    assert_same(mg.load(tmp_path / "parts").initial, GIVEN)
    with pytest.raises(RunDirectoryError, match=r"run\.initial was '\w+' and is now None"):
        go(None, tmp_path / "parts", agent=agent)


def test_an_agent_made_by_hand_that_was_killed_at_once_begins_again(tmp_path):
    agent = mg.Agent(pools()[0], *_parts())
    run = go(out=tmp_path, agent=agent)
    for folder in ("checkpoint", "metrics"):
        shutil.rmtree(tmp_path / folder)
    assert_same(columns(go(out=tmp_path, agent=agent).metrics), columns(run.metrics))
    assert_same(mg.load(tmp_path).initial, GIVEN)


def test_no_directory_has_no_given_beginnings(tmp_path):
    assert given_initial(tmp_path / "none") is None
    go(None, tmp_path / "own")
    assert given_initial(tmp_path / "own") is None


def bad(**changes):
    return eqx.tree_at(lambda p: [getattr(p, name) for name in changes], GIVEN, list(changes.values()))


@pytest.mark.parametrize(
    ("initial", "names"),
    [
        ([1.0], "initial = [1.0]: must be policies of all seeds along a leading axis"),
        (Softmax(np.zeros((2, 3))), "initial = 'Softmax': must be of the kind of the agent's policy, Motoneurons"),
        (stack([Hyperplanes(np.zeros((3, 1)), np.zeros(3))] * 2), "initial = 'Hyperplanes'"),
        (stack(pools(2)[1]), "initial.threshold.shape = (2, 2): must be (2, 3)"),
        (stack(pools()[1] * 2), "initial.threshold.shape = (4, 3): must be (2, 3)"),
        (pools()[0], "initial.threshold.shape = (3,): must be (2, 3)"),
        (bad(gain=np.full((2, 3), np.nan)), "initial.gain = 'not all finite': must be finite numbers"),
    ],
)
def test_what_does_not_fit_is_refused_by_name_before_any_work(initial, names, tmp_path):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        go(initial, tmp_path / "run")
    assert names in str(error.value)
    assert not (tmp_path / "run").exists()
