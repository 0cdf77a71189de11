"""Environments with a picture of their own, for tests."""

import gymnasium
import numpy as np


class Lamp(gymnasium.Env):
    """A lamp that moves by one pixel a step; its picture has it as a white column on black, with a red corner above on
    the left and a blue one below on the right.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012
    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, fails=False):
        self.place, self.canvas, self.render_mode, self.fails = 0, None, None, fails

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = 0
        return self._seen(), {}

    def step(self, action):
        self.place += 1
        return self._seen(), float(action), False, self.place >= 60, {}

    def render(self):
        if self.fails:
            raise RuntimeError("a library is missing")
        assert self.render_mode == "rgb_array"
        if self.canvas is None:
            self.canvas = memoryview(bytearray(64 * 64 * 3))  # which no state can hold
        picture = np.frombuffer(self.canvas, np.uint8).reshape(64, 64, 3)
        picture[:] = 0
        picture[:, self.place % 64] = 255
        picture[2:18, 2:18], picture[-18:-2, -18:-2] = (255, 0, 0), (0, 0, 255)
        return picture

    def _seen(self):
        return np.array([self.place / 64], np.float32)
