"""One environment: what it says, what it refuses, when it ends."""

import threading
import time

import gymnasium
import numpy as np
import pytest
from environment_examples import HOPPER, assert_equal, break_body, hopping

from motorgrad import _gymnasium_ids
from motorgrad.environments import TaskEnv, TaskVectorEnv
from motorgrad.environments._spaces import check_action
from motorgrad.tasks import Chain, Hopper

IDS = sorted(_gymnasium_ids.TASK_OF)


DECISIONS = 20  # fewer than any episode has


def story(environment, seeds, decisions=DECISIONS):
    """Everything that happens from resets with these seeds on, with actions that do not depend on them."""
    told = []
    environment.action_space.seed(3)
    for seed in seeds:
        told.append(environment.reset(seed=seed))
        told += [environment.step(environment.action_space.sample()) for _ in range(decisions)]
    return told


FEW = [f"motorgrad/{name}-v0" for name in ("CallAdmission", "Composed", "Hopper", "LinearRecruitment")]


@pytest.mark.ci
@pytest.mark.representatives(*FEW)
@pytest.mark.parametrize("name", IDS)
def test_a_seed_says_everything(name):
    one, other = gymnasium.make(name), gymnasium.make(name)
    first, again = story(one, [7, None]), story(other, [7, None])
    for found, wanted in zip(first, again, strict=True):
        for part, other_part in zip(found, wanted, strict=True):
            assert_equal(part, other_part)
    # also when the environment has lived before
    assert_equal(story(one, [7])[-1][0], first[DECISIONS][0])


@pytest.mark.parametrize("name", ["motorgrad/ThreeState-v0", "motorgrad/CallAdmission-v0"])
def test_other_seeds_and_later_episodes_are_different_where_there_is_chance(name):
    environment = gymnasium.make(name)
    seen = [np.stack([part[0] for part in story(environment, [seed])]) for seed in (1, 2, None, None)]
    assert all(not np.array_equal(seen[i], seen[j]) for i in range(4) for j in range(i))


def test_the_hopper_is_as_described():
    environment = gymnasium.make(HOPPER)
    assert environment.action_space == gymnasium.spaces.MultiBinary(2)
    assert environment.observation_space.shape == (3,)
    assert environment.metadata["render_fps"] == 100
    observation, info = environment.reset(seed=0)
    np.testing.assert_array_equal(observation, np.array([1, 0, 0], np.float32))
    assert info == {"simulated_time": 0.0, "diverged": False}
    observation, reward, terminated, truncated, info = environment.step([1, 1])
    assert reward == pytest.approx(-0.4)
    assert info["simulated_time"] == pytest.approx(0.01)
    assert type(reward) is float
    assert (type(terminated), type(truncated)) == (bool, bool)


def test_an_apex_is_told_when_it_occurs_and_paid():
    environment = gymnasium.make(HOPPER, penalty=0.0)
    environment.reset(seed=0)
    told = [environment.step(hopping(decision)) for decision in range(300)]
    apexes = [(reward, info["apex"]) for _, reward, _, _, info in told if "apex" in info]
    assert len(apexes) >= 2
    for reward, apex in apexes:
        assert apex > 0.03
        assert reward == pytest.approx(100 * apex)
    assert all(reward == 0 for _, reward, _, _, info in told if "apex" not in info)


@pytest.mark.ci
@pytest.mark.representatives("limits1-50", "limits3-30")
@pytest.mark.parametrize(
    ("limits", "length"),
    [
        ({}, 1000),
        ({"time_limit": 0.5}, 50),
        ({"max_episode_steps": 30}, 30),
        ({"time_limit": 0.5, "max_episode_steps": 30}, 30),
        ({"time_limit": 0.2, "max_episode_steps": 30}, 20),
        ({"time_limit": 11.0, "max_episode_steps": -1}, 1100),
        ({"max_episode_steps": 1050}, 1050),
    ],
)
def test_both_forms_keep_the_same_limits(limits, length):
    single = gymnasium.make(HOPPER, **limits)
    vector = gymnasium.make_vec(HOPPER, num_envs=2, **limits)
    single.reset(seed=0)
    vector.reset(seed=0)
    for decision in range(1, length + 1):
        *_, terminated, truncated, _ = single.step([0, 0])
        *_, terminations, truncations, _ = vector.step(np.zeros((2, 2), np.int8))
        assert not terminated
        assert not terminations.any()
        assert truncated == (decision == length)
        assert (truncations == truncated).all()
    vector.close()


def test_a_divergence_truncates_and_says_so():
    environment = gymnasium.make(HOPPER)
    environment.reset(seed=0)
    start, _ = environment.reset()
    for _ in range(5):
        environment.step([0, 1])
    break_body(environment)
    observation, reward, terminated, truncated, info = environment.step([0, 1])
    assert (reward, terminated, truncated, info["diverged"]) == (0.0, False, True, True)
    assert observation in environment.observation_space
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step([0, 1])
    again, info = environment.reset()
    assert_equal(again, start)
    assert not info["diverged"]


@pytest.mark.parametrize(
    ("name", "action", "message"),
    [
        (HOPPER, [1], r"action.shape = \(1,\): must be \(2,\)"),
        (HOPPER, [0, 2], r"action = \[0, 2\]: must be zeros and ones"),
        (HOPPER, [0, [1]], r"action = \[0, \[1\]\]: must be numbers, as many in each row"),
        (HOPPER, [0, 1j], "action.dtype = .* must be a number's"),
        (HOPPER, [0.5, 1], "must be zeros and ones"),
        (HOPPER, [np.nan, 1], "must be zeros and ones"),
        (HOPPER, ["on", "off"], "action.dtype = .* must be a number's"),
        (HOPPER, None, r"action.shape = \(\)"),
        ("motorgrad/Chain-v0", 2, r"action = 2: must be from 0 to 1"),
        ("motorgrad/Chain-v0", -1, r"action = -1: must be from 0 to 1"),
        ("motorgrad/Chain-v0", 1.0, "action.dtype = .* must be integer"),
        ("motorgrad/Chain-v0", [1], r"action.shape = \(1,\): must be \(\)"),
    ],
)
def test_a_bad_action_is_refused(name, action, message):
    environment = gymnasium.make(name)
    environment.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        environment.unwrapped.step(action)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"penality": 0.2}, "unknown setting of hopper 'penality': did you mean 'penalty'"),
        ({"body": {"load_mas": 3.0}}, "did you mean 'load_mass'"),
        ({"penalty": -1}, "penalty = -1"),
        ({"time_limit": 0.001}, "time_limit = 0.001"),
        ({"reward_type": "apx"}, "did you mean 'apex'"),
        ({"render_mode": "rgb_arry"}, "did you mean 'rgb_array'"),
        ({"render_mode": "rgb_array", "width": 63}, "width = 63: must be an even"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*The environment is being initialised with render_mode")  # Gymnasium's own
def test_bad_settings_are_refused(settings, message):
    for make in (gymnasium.make, gymnasium.make_vec):
        with pytest.raises(ValueError, match=message):
            make(HOPPER, **settings)


def test_settings_reach_the_task():
    body = {"load_mass": 3.0}
    environment = gymnasium.make(HOPPER, reward_type="apex", body=body, time_limit=5.0, penalty=0.2)
    task = environment.unwrapped.task
    assert (task.reward_type, task.body.load_mass, task.time_limit, task.penalty) == ("apex", 3.0, 5.0, 0.2)


def test_a_task_of_ones_own_becomes_an_environment():
    environment = TaskEnv(Chain(length=3, time_limit=2))
    assert environment.reset(seed=1)[0].shape == (3,)
    with pytest.raises(ValueError, match="already made"):
        TaskEnv(Chain(), length=4)
    with pytest.raises(ValueError, match="task = 3: must be a task"):
        TaskEnv(3)  # type: ignore[arg-type]


def test_a_step_needs_a_reset_and_an_environment_that_is_open():
    environment = TaskEnv(Hopper(time_limit=0.02))
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        environment.step([0, 0])
    environment.reset()
    environment.step([0, 0])
    environment.step([0, 0])
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        environment.step([0, 0])
    environment.close()
    environment.close()
    for act in (lambda: environment.step([0, 0]), environment.reset):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError):
            act()


def test_unknown_options_are_refused():
    with pytest.raises(ValueError, match="unknown option of reset 'height'"):
        TaskEnv("chain").reset(options={"height": 2})


def threads():
    """The threads of this process, also those that Python does not know."""
    try:
        with open("/proc/self/status") as status:
            return int(next(line for line in status if line.startswith("Threads:")).split()[1])
    except FileNotFoundError:
        pytest.skip(f"this system does not tell its threads (Python knows {threading.active_count()})")


def test_closing_lets_the_threads_go():
    def live():
        vector = gymnasium.make_vec(HOPPER, num_envs=8, threads=5)
        vector.reset(seed=0)
        vector.step(vector.action_space.sample())
        return vector

    live().close()  # what is made once for the process is made
    before = threads()
    vector = live()
    assert threads() >= before + 4
    vector.close()
    deadline = time.monotonic() + 300
    while threads() > before and time.monotonic() < deadline:  # the system may take a while to forget one that ended
        time.sleep(0.01)
    assert threads() <= before


@pytest.mark.ci
@pytest.mark.representatives("motorgrad/Chain-v0", "motorgrad/Hopper-v0")
@pytest.mark.parametrize("name", IDS)
def test_the_specification_makes_another_one(name):
    environment = gymnasium.make(name, time_limit=7 if "Hopper" not in name else 0.07)
    twin = gymnasium.make(type(environment.spec).from_json(environment.spec.to_json()))
    assert twin.spec == environment.spec
    assert twin.unwrapped.task == environment.unwrapped.task
    for found, wanted in zip(story(twin, [3], 7), story(environment, [3], 7), strict=True):
        assert_equal(found[0], wanted[0])


def test_statistics_are_recorded():
    environment = gymnasium.wrappers.RecordEpisodeStatistics(gymnasium.make(HOPPER, time_limit=0.1))
    environment.reset(seed=0)
    rewards = []
    for _ in range(10):
        _, reward, _, truncated, info = environment.step([1, 0])
        rewards.append(reward)
    assert truncated
    assert info["episode"]["l"] == 10
    assert info["episode"]["r"] == pytest.approx(sum(rewards))


@pytest.mark.parametrize(
    "action", [np.int8([-128, 0]), np.uint64([2**63, 0]), [1 + 1e-6, 0], [np.nan, 0], [-np.inf, 0]]
)
def test_the_range_of_graded_actions_is_checked_in_the_type_that_comes(action):
    space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    with pytest.raises(ValueError, match=r"action = .* must be numbers from -1 to 1"):
        check_action(space, action)
    np.testing.assert_array_equal(check_action(space, np.int8([-1, 1])), np.float32([-1, 1]))


def test_options_and_seeds_of_other_types_are_refused_by_name():
    environment = gymnasium.make("motorgrad/Chain-v0").unwrapped
    with pytest.raises(ValueError, match="options = 5: must be a dictionary, or None"):
        environment.reset(options=5)
    vector = TaskVectorEnv(2, "chain")
    for seed in (1.5, {1, 2}):
        with pytest.raises(ValueError, match=r"seed = .*: must be one number, or 2 of them"):
            vector.reset(seed=seed)
    with pytest.raises(ValueError, match=r"reset_mask = .*: must be numbers, as many in each row"):
        vector.reset(options={"reset_mask": [[True], [True, False]]})
