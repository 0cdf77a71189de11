"""The hexapod's mirror: against its own physics; policies that are made of it; and what has none."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.bodies import BodyBatch, BodyState, biomimetic_hexapod, read_hexapod
from motorgrad.bodies import Hexapod as HexapodBody
from motorgrad.cli import main
from motorgrad.policies import Hyperplanes, Mirrored, initial, mirrored
from motorgrad.tasks import TASKS, Hexapod, HexapodSynergy, Mirror
from motorgrad.tasks.hexapod._hexapod import SENSES
from motorgrad.training import agent_for, train

BODIES = {"plain": HexapodBody(), "biomimetic": biomimetic_hexapod(), "yawing spine": HexapodBody(spine_axis="yaw")}
TASKS_HERE = {
    "muscles": Hexapod(observes=SENSES, lag=1, course=10),
    "tripods": HexapodSynergy(observes=SENSES, course=10, reward_type="course"),
    "legs": Hexapod(
        observes=("yaw", "lateral"),
        reward_type="x",
        synergies=(
            *(f"{kind}_{side}_*" for kind in ("protractor", "levator") for side in ("left", "right")),
            "retractor_left_rear depressor_left_* depressor_right_front",
            "retractor_right_rear depressor_right_* depressor_left_front",
        ),
    ),
}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo notes divergences in the working directory


def two_walks(task, decisions, mirror):
    """What is observed and paid, and where the body is, of random actions and of the mirrored ones."""
    batch, random = BodyBatch(task.dynamics, 2, substeps=task.substeps, threads=1), np.random.default_rng(0)
    memories, observed, paid, places = [task.init(jnp.zeros(0))] * 2, [], [], []

    @jax.jit
    def decide(memory, state, action):
        memory, reward, _ = task.reward(memory, state, action)
        return *task.observe(memory, state, jnp.zeros(0)), reward

    for _ in range(decisions):
        action = random.integers(0, 2, task.action_size).astype(np.float32)
        batch.step(task.control(np.stack([action, action[list(mirror.outputs)]])))
        state, seen, rewards = batch.unpack(batch.packed.copy()), [], []
        for n in range(2):
            sensors = {name: values[n] for name, values in state.sensors.items()}
            mine = BodyState(state.position[n], state.velocity[n], sensors)
            memories[n], inputs, reward = decide(memories[n], mine, action)
            seen.append(inputs)
            rewards.append(reward)
        observed.append(seen)
        paid.append(rewards)
        places.append(read_hexapod(state).position)
    return np.array(observed), np.array(paid), np.array(places)


@pytest.mark.ci
@pytest.mark.representatives("muscles-plain")
@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("name", TASKS_HERE)
def test_mirrored_actions_move_the_body_as_in_the_mirror(name, body):
    task = dataclasses.replace(TASKS_HERE[name], body=BODIES[body])
    mirror = task.mirror
    assert mirror is not None
    observed, paid, places = two_walks(task, 60, mirror)
    wanted = np.array(mirror.signs) * observed[:, 0, list(mirror.inputs)]
    # single precision, and contacts, which grow what double precision rounds
    np.testing.assert_allclose(observed[:, 1], wanted, atol=1e-5)
    np.testing.assert_allclose(paid[:, 1], paid[:, 0], atol=1e-5)
    np.testing.assert_allclose(places[:, 1], places[:, 0] * [1, -1, 1], atol=1e-5)
    # the walks are no walks straight on, in which nothing could be wrong
    assert np.abs(places[:, 0, 1]).max() > 0.01
    away = np.abs(observed[:, 1] - observed[:, 0]).max(0)
    own = (np.array(mirror.inputs) == np.arange(len(away))) & (np.array(mirror.signs) == 1)  # such as the trunk's pitch
    assert away[~own].min() > 0.02
    assert np.abs(observed).max(axis=(0, 1)).min() > 0.02


def test_swapping_only_the_legs_or_only_the_signs_is_no_mirror():
    task = TASKS_HERE["muscles"]
    mirror = task.mirror
    observed, *_ = two_walks(task, 60, mirror)
    for wrong in (mirror._replace(signs=(1,) * 46), mirror._replace(inputs=tuple(range(46)))):
        image = np.array(wrong.signs) * observed[:, 0, list(wrong.inputs)]
        assert np.abs(image - observed[:, 1]).max() > 0.1


def test_the_mirror_swaps_legs_muscles_and_the_signs_of_turns():
    legs = (3, 4, 5, 0, 1, 2)
    mirror = Hexapod(observes=("course", "contact", "lateral")).mirror
    assert mirror == Mirror(
        (*legs, *(6 + leg for leg in legs), 12),
        (*[1] * 12, -1),
        tuple(6 * kind + leg for kind in range(4) for leg in legs),
    )
    assert HexapodSynergy().mirror == Mirror(legs, (1,) * 6, (2, 3, 0, 1))
    rough = mg.make("hexapod", terrain={"kind": "waves", "difficulty": 0.5})
    assert rough.mirror == Hexapod().mirror
    for task in TASKS.values():
        assert (task().mirror is not None) == issubclass(task, Hexapod)


def test_a_policy_of_it_acts_in_the_mirror_as_in_the_mirror():
    task = TASKS_HERE["tripods"]
    policy, mirror = initial("mirrored", task), task.mirror
    assert isinstance(policy, Mirrored)
    assert policy.pool.weights.shape == (2, 46)
    random = np.random.default_rng(0)
    pool = Hyperplanes(random.normal(size=(2, 46)), random.normal(size=2))
    policy = Mirrored(pool, policy.order, policy.signs, policy.left, policy.right)
    observed, *_ = two_walks(task, 20, mirror)
    prob = jax.jit(jax.vmap(policy.prob))
    here, there = (np.asarray(prob(seen)) for seen in observed.swapaxes(0, 1))
    np.testing.assert_allclose(there, here[:, list(mirror.outputs)], atol=1e-5)
    assert np.abs(there - here).max() > 0.1


UNLIKE = {
    "no image": ("levator_left_front", "levator_right_rear"),
    "one of two": ("levator_left_*", "levator_right_*", "depressor_left_*"),
    "twice and once": ("levator_left_*", "levator_left_*", "levator_right_*"),
}


@pytest.mark.parametrize("name", UNLIKE)
def test_synergies_without_their_image_have_no_mirror_and_no_mirrored_policy(name):
    task = Hexapod(synergies=UNLIKE[name])
    assert task.mirror is None
    with pytest.raises(ValueError, match="needs a task with a mirror of left and right, task 'hexapod' has none"):
        mirrored(task)


def test_synergies_of_both_sides_are_their_own_image_and_are_refused_by_number():
    task = Hexapod(synergies=("levator_left_*", "depressor_*", "levator_right_*"))
    assert task.mirror.outputs == (2, 1, 0)
    with pytest.raises(ValueError, match=r"actions \[1\] of task 'hexapod' are their own mirror image"):
        mirrored(task)


def test_equal_synergies_are_paired_in_their_order():
    left, right = "levator_left_*", "levator_right_*"
    assert Hexapod(synergies=(left, left, right, right)).mirror.outputs == (2, 3, 0, 1)
    assert Hexapod(synergies=(left, right, right, left)).mirror.outputs == (1, 0, 3, 2)


@pytest.mark.slow
def test_a_run_with_everything_resumes_and_loads(tmp_path):
    task = HexapodSynergy(observes=SENSES)
    changes = {
        "policy": "mirrored",
        "metric": {"kind": "fisher", "kl": 0.01},
        "baseline": {"kind": "critic", "fit": "td"},
        "averaging": "polyak",
        "entropy": 0.01,
        "update_every": 10,
    }
    agent = agent_for(task, changes)
    whole = train(task, agent, steps=40, seeds=2, out=tmp_path / "whole", window=10, progress=False)
    for steps in (20, 40):
        train(task, agent, steps=steps, seeds=2, out=tmp_path / "parts", window=10, progress=False)
    loaded = mg.load(tmp_path / "parts")
    assert isinstance(loaded.policies, Mirrored)
    assert (loaded.policies.order, loaded.policies.signs) == (task.mirror.inputs, task.mirror.signs)
    for one, other in zip(*map(jax.tree.leaves, (whole.policies, loaded.policies)), strict=True):
        np.testing.assert_array_equal(one, other)
    assert loaded.policies.pool.weights.shape == (2, 2, 46)
    assert np.abs(loaded.policies.pool.weights).max() > 0


@pytest.mark.slow
def test_the_command_line_trains_it_and_refuses_a_task_without_sides(capsys):
    arguments = ["--steps", "10", "--seeds", "1", "--agent.policy", "mirrored"]
    assert main(["train", "hexapod", *arguments, "--out", "run"]) == 0
    assert mg.load("run").policies.pool.weights.shape == (1, 12, 20)
    capsys.readouterr()
    assert main(["train", "hopper", *arguments]) != 0
    said = " ".join("".join(capsys.readouterr()).split())
    assert "policy = 'mirrored': needs a task with a mirror of left and right, task 'hopper' has none" in said
