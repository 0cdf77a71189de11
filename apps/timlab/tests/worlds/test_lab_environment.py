"""Gymnasium environments as blocks."""

import gymnasium
import numpy as np
import pytest

import timlab


class Unsaved(gymnasium.Env):
    """An environment that cannot be serialised: it holds a generator."""

    observation_space = gymnasium.spaces.Box(-1, 1, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self):
        self.numbers = (0.1 * n for n in range(1000))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.full(1, next(self.numbers) % 1, np.float32), 1.0, False, False, {}


gymnasium.register("LabUnsaved-v0", entry_point=Unsaved)


def test_it_is_the_environment():
    diagram = timlab.Diagram(tick=0.02)
    diagram.add("world", timlab.Environment("CartPole-v1", "scaling = 'none'"))
    diagram.add("push", timlab.Inlet(0, kind="int"))
    diagram.connect("push", "world.action")
    watch = ["world.observation", "world.next_observation", "world.reward", "world.ended", "push.y"]
    record = timlab.Run(diagram, [8, 9], watch=watch, sweep={"push.value": [0, 1]}).advance(60)
    for row, seed in enumerate((8, 9)):
        environment = gymnasium.make("CartPole-v1")
        seen, _ = environment.reset(seed=seed)
        for tick in range(59):
            np.testing.assert_allclose(record["world.observation"][row, tick, :4], seen, rtol=1e-6)
            action = int(record["push.y"][row, tick])
            seen, reward, terminated, _, _ = environment.step(action)
            np.testing.assert_allclose(record["world.next_observation"][row, tick + 1, :4], seen, rtol=1e-6)
            assert record["world.reward"][row, tick + 1] == reward
            assert record["world.ended"][row, tick + 1] == terminated
            if terminated:
                seen, _ = environment.reset()
    assert record["world.ended"].any()


def test_one_that_cannot_be_saved_says_so_before_it_runs():
    diagram = timlab.Diagram()
    diagram.add("world", timlab.Environment("LabUnsaved-v0"))
    diagram.add("push", timlab.Inlet(0, kind="int"))
    diagram.connect("push", "world.action")
    run = timlab.Run(diagram, 2)
    assert "cannot be written as data" in run.no_restore["world"]
    with pytest.raises(ValueError, match="world: cannot be saved: LabUnsaved-v0"):
        _ = run.state
    run.advance(5)
    assert timlab.Environment().no_restore is None


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"env_id": "CratPole-v1"}, "env_id = 'CratPole-v1'"),
        ({"env_id": "os:system-v0"}, "must be the id of a registered environment"),
        ({"env_id": 3}, "env_id = 3"),
        ({"settings": "repeat = 0"}, "repeat = 0"),
        ({"settings": "kwargs.nothing = 1"}, "cannot be made"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(given, told):
    with pytest.raises(ValueError, match=told) as raised:
        timlab.Environment(**given)
    assert "\n" not in str(raised.value)
