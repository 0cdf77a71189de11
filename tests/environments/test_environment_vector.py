"""Many rows: the same numbers as one environment after the other, the next episode after the last."""

import cloudpickle
import gymnasium
import numpy as np
import pytest
from environment_examples import HOPPER, assert_equal, break_body, hopping
from gymnasium.vector import AutoresetMode

from motorgrad.environments import TaskEnv, TaskVectorEnv
from motorgrad.tasks import Hopper

CASES = [
    ("Hopper", {"time_limit": 0.75, "reward_type": "apex"}),
    ("Hopper", {"max_episode_steps": 75, "penalty": 0.2}),
    ("Chain", {"time_limit": 30}),
    ("ThreeState", {"max_episode_steps": 20}),
    ("CallAdmission", {"time_limit": 30, "max_episode_steps": 9}),
]


def actions_of(vector, decisions):
    vector.action_space.seed(1)
    for decision in range(decisions):
        actions = vector.action_space.sample()
        if vector.single_action_space.shape == (2,) and decision % 4:
            actions[:] = hopping(decision)
        yield actions


@pytest.mark.ci
@pytest.mark.representatives("Hopper-settings1-3", "CallAdmission-settings4-3")
@pytest.mark.parametrize("rows", [1, 3, 16])
@pytest.mark.parametrize(("name", "settings"), CASES)
def test_rows_are_single_environments_bit_for_bit(name, settings, rows):
    """Beside Gymnasium's own loop over single ones: observations, rewards, ends and infos, over several episodes."""
    name = f"motorgrad/{name}-v0"
    ours = gymnasium.make_vec(name, num_envs=rows, **settings)
    theirs = gymnasium.make_vec(name, num_envs=rows, vectorization_mode="sync", **settings)
    assert isinstance(ours, TaskVectorEnv)
    for attribute in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(ours, attribute) == getattr(theirs, attribute)
    for seed in (7, None):
        for found, wanted in zip(ours.reset(seed=seed), theirs.reset(seed=seed), strict=True):
            assert_equal(found, wanted)
        ended = 0
        for actions in actions_of(ours, 160):
            found = ours.step(actions)
            for part, wanted in zip(found, theirs.step(actions), strict=True):
                assert_equal(part, wanted)
            assert found[0] in ours.observation_space
            ended += found[3].sum()
        assert ended >= 2 * rows
    ours.close()
    theirs.close()


@pytest.mark.ci
def test_another_process_makes_the_same_numbers():
    # not forked: the threads of JAX and MuJoCo would not come along
    options = {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}}
    theirs = gymnasium.make_vec("motorgrad/ThreeState-v0", num_envs=2, time_limit=5, **options)
    ours = gymnasium.make_vec("motorgrad/ThreeState-v0", num_envs=2, time_limit=5)
    try:
        assert_equal(ours.reset(seed=3)[0], theirs.reset(seed=3)[0])
        for actions in actions_of(ours, 12):
            for part, wanted in zip(ours.step(actions), theirs.step(actions), strict=True):
                assert_equal(part, wanted)
    finally:
        theirs.close()


def test_the_next_episode_begins_with_the_next_step():
    vector = gymnasium.make_vec("motorgrad/CallAdmission-v0", num_envs=3, time_limit=4)
    assert vector.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    start, _ = vector.reset(seed=0)
    actions = np.ones((3, 1), np.int8)
    for decision in range(1, 15):
        observation, reward, terminations, truncations, info = vector.step(actions)
        phase = decision % 5
        assert (truncations == (phase == 4)).all()
        assert not terminations.any()
        np.testing.assert_array_equal(info["simulated_time"], np.full(3, float(phase)))
        if phase == 0:
            np.testing.assert_array_equal(reward, 0)
            np.testing.assert_array_equal(observation[:, -1], start[:, -1])  # no calls on the link yet


def test_one_row_diverges_alone():
    hurt, healthy = (gymnasium.make_vec(HOPPER, num_envs=3) for _ in range(2))
    for vector in (hurt, healthy):
        vector.reset(seed=0)
    start = hurt.reset()[0]
    healthy.reset()
    for decision in range(40):
        actions = np.tile(hopping(decision), (3, 1))
        if decision == 20:
            break_body(hurt, 1)
        found, wanted = hurt.step(actions), healthy.step(actions)
        for part, other in zip(found[:4], wanted[:4], strict=True):
            assert_equal(part[[0, 2]], other[[0, 2]])
        assert_equal(found[4]["diverged"], np.array([False, decision == 20, False]))
        assert_equal(found[3], np.array([False, decision == 20, False]))
        assert not found[2].any()
        if decision in (20, 21):
            assert found[1][1] == 0
            assert_equal(found[0][1], start[1])
        if decision >= 21:
            assert found[4]["simulated_time"][1] == pytest.approx(0.01 * (decision - 21))


def test_what_is_handed_out_is_the_callers():
    vector, untouched = (gymnasium.make_vec("motorgrad/Chain-v0", num_envs=2, time_limit=3) for _ in range(2))
    vector.reset(seed=0)
    untouched.reset(seed=0)
    for _ in range(8):
        actions = np.ones(2, int)
        found, wanted = vector.step(actions), untouched.step(np.ones(2, int))
        for part, other in zip(found, wanted, strict=True):
            assert_equal(part, other)
        for part in (actions, *found[:4], *found[4].values()):
            part[...] = 1


def test_some_rows_begin_anew():
    vector = gymnasium.make_vec("motorgrad/CallAdmission-v0", num_envs=3)
    with pytest.raises(ValueError, match=r"reset_mask = .* true in every row the first time"):
        vector.reset(options={"reset_mask": np.array([True, False, True])})
    vector.reset(seed=0)
    for _ in range(5):
        observation, *_ = vector.step(np.ones((3, 1), np.int8))
    mask = np.array([False, True, False])
    found, info = vector.reset(seed=[9, 9, 9], options={"reset_mask": mask})
    np.testing.assert_array_equal(found[~mask], observation[~mask])
    single = TaskEnv("call-admission")
    assert_equal(found[1], single.reset(seed=9)[0])
    np.testing.assert_array_equal(info["_simulated_time"], mask)
    *_, info = vector.step(np.ones((3, 1), np.int8))
    np.testing.assert_array_equal(info["simulated_time"], [6, 1, 6])
    for bad in ([True, False, True], np.ones(2, bool), np.ones(3)):
        if not isinstance(bad, list):
            with pytest.raises(ValueError, match="reset_mask"):
                vector.reset(options={"reset_mask": bad})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "num_envs = 0: must be an integer >= 1"),
        ({"max_episode_steps": 0}, "max_episode_steps = 0: must be at least 1, or -1"),
        ({"max_episode_steps": 2.5}, "max_episode_steps = 2.5"),
        ({"threads": -1}, "threads = -1"),
        ({"render_mode": "human"}, "unknown render_mode 'human'"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        TaskVectorEnv(**{"num_envs": 2, **arguments})


def test_bad_actions_and_seeds_are_refused():
    vector = TaskVectorEnv(2, "chain")
    with pytest.raises(gymnasium.error.ResetNeeded):
        vector.step([0, 0])
    with pytest.raises(ValueError, match=r"seed = \[1\]: must be one number, or 2"):
        vector.reset(seed=[1])
    vector.reset(seed=1)
    with pytest.raises(ValueError, match=r"action.shape = \(3,\): must be \(2,\)"):
        vector.step([0, 0, 1])
    with pytest.raises(ValueError, match="must be from 0 to 1"):
        vector.step([0, 2])
    vector.close()
    vector.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        vector.step([0, 0])


def test_gymnasium_vector_wrappers_fit():
    vector = gymnasium.make_vec(HOPPER, num_envs=2, time_limit=0.1)
    vector = gymnasium.wrappers.vector.RecordEpisodeStatistics(vector)
    vector = gymnasium.wrappers.vector.NormalizeObservation(vector)
    vector = gymnasium.wrappers.vector.DictInfoToList(vector)
    vector.reset(seed=0)
    for _ in range(10):
        observation, _, _, truncations, info = vector.step(vector.action_space.sample())
    assert truncations.all()
    assert [one["episode"]["l"] for one in info] == [10, 10]
    assert [one["diverged"] for one in info] == [False, False]
    assert np.isfinite(observation).all()


def test_the_specification_makes_another_one():
    vector = gymnasium.make_vec(HOPPER, num_envs=3, reward_type="apex", time_limit=0.2)
    twin = gymnasium.make_vec(cloudpickle.loads(cloudpickle.dumps(vector.spec)))
    assert twin.num_envs == 3
    assert twin.task == vector.task == Hopper(reward_type="apex", time_limit=0.2)
