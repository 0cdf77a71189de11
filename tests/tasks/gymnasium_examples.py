"""What tests of tasks on environments share."""

import gymnasium
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces

NONE = jnp.zeros(0)  # no numbers by chance


class Told(gymnasium.Env):
    """An environment of given spaces that shows what it is told and how often; it ends and cuts when asked to."""

    def __init__(self, observation=None, action=None, end=None, cut=None, bad=None, shown=None):
        self.observation_space = spaces.Box(-1, 1, (2,)) if observation is None else observation
        self.action_space = spaces.Discrete(2) if action is None else action
        self.end, self.cut, self.bad, self.shown = end, cut, bad, shown
        self.told, self.time = [], 0

    def look(self):
        if self.shown is not None:
            return np.asarray(self.shown, self.observation_space.dtype)
        value = np.full(self.observation_space.shape, self.time / 10, self.observation_space.dtype)
        return value

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.time = 0
        return self.look(), {}

    def step(self, action):
        assert self.action_space.contains(action), action
        self.told.append(action)
        self.time += 1
        seen = self.look()
        if self.time == self.bad:
            seen = np.full_like(seen, np.nan)
        return seen, float(self.time), self.time == self.end, self.time == self.cut, {}


class Reporting(Told):
    """Also reports in `info`: what `report(time)` returns at a step."""

    def __init__(self, report, **settings):
        super().__init__(**settings)
        self.report = report

    def step(self, action):
        *outcome, _ = super().step(action)
        return *outcome, self.report(self.time)
