"""The checkers of Gymnasium and of Stable-Baselines3 find nothing to say; a warning would be an error here."""

import contextlib

import gymnasium
import numpy as np
import pytest
from environment_examples import HOPPER
from gymnasium.utils.env_checker import check_env

from motorgrad import _gymnasium_ids
from motorgrad.environments import TaskEnv
from motorgrad.tasks import Hopper

needs_peers = pytest.mark.needs("motorgrad[peers]")


@pytest.fixture(autouse=True, scope="module")
def _one_thread_of_torch():
    # many for so small a network only wait for one another
    with contextlib.suppress(ImportError):
        import torch

        torch.set_num_threads(1)


IDS = sorted(_gymnasium_ids.TASK_OF)
own_range = pytest.mark.filterwarnings("ignore:.*symmetric and normalized")
"""Actions may have ranges of their own, such as 0 to 1 for muscles, though both checkers recommend −1 to 1."""
FEW = [f"motorgrad/{name}-v0" for name in ("Chain", "Hopper", "LinearRecruitment")]


@pytest.mark.ci
@own_range
@pytest.mark.representatives(*FEW)
@pytest.mark.parametrize("name", IDS)
def test_gymnasium_finds_nothing(name):
    environment = gymnasium.make(name)
    check_env(environment.unwrapped)
    environment.close()


@pytest.mark.ci
def test_gymnasium_finds_nothing_in_a_picture():
    environment = gymnasium.make(HOPPER, render_mode="rgb_array", width=64, height=64)
    check_env(environment.unwrapped)
    environment.close()


@pytest.mark.ci
@needs_peers
@own_range
@pytest.mark.representatives(*FEW)
@pytest.mark.parametrize("name", IDS)
def test_stable_baselines_finds_nothing(name):
    from stable_baselines3.common import env_checker as checker

    for environment in (gymnasium.make(name), gymnasium.make(name).unwrapped):
        checker.check_env(environment)
        environment.close()


@pytest.mark.ci
@needs_peers
def test_ppo_of_stable_baselines_learns_a_little():
    """On the chain, one way leads to all reward: a few hundred decisions are enough to prefer it."""
    import stable_baselines3 as sb3

    environment = gymnasium.make("motorgrad/Chain-v0", length=3, time_limit=16)
    model = sb3.PPO("MlpPolicy", environment, n_steps=64, batch_size=32, learning_rate=3e-3, seed=0, device="cpu")

    def earned():
        observation, _ = environment.reset(seed=5)
        total, over = 0.0, False
        while not over:
            action, _ = model.predict(observation, deterministic=True)
            observation, reward, terminated, truncated, _ = environment.step(action)
            total, over = total + reward, terminated or truncated
        return total

    before = earned()
    model.learn(768)
    assert earned() > before
    assert earned() >= 4  # 16 decisions hold five ways to the end
    environment.close()


@pytest.mark.ci
@needs_peers
def test_ppo_of_stable_baselines_moves_muscles():
    import stable_baselines3 as sb3

    model = sb3.PPO("MlpPolicy", TaskEnv(Hopper(time_limit=1.0)), n_steps=128, batch_size=64, seed=0, device="cpu")
    before = [leaf.detach().clone() for leaf in model.policy.parameters()]
    model.learn(256)
    after = list(model.policy.parameters())
    assert all(np.isfinite(leaf.detach().numpy()).all() for leaf in after)
    assert any((one != other).any() for one, other in zip(before, after, strict=True))
    # two episodes of 100 decisions were finished, and each was seen to have been cut
    assert [info["l"] for info in model.ep_info_buffer] == [100, 100]
