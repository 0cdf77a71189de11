"""A plane that rises and sinks under a body: gravity is tilted instead."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies._batch import BodyBatch
from motorgrad.bodies._body import Body


class SlopeBatch(BodyBatch):
    """Simulations on a plane whose slope is set anew at every decision, for each seed by itself.

    To walk up a plane is to walk on a level one under a gravity that is tilted backwards, so nothing but gravity's
    direction changes. Its size is the model's. Positions, velocities and sensors stay those of the plane: how far a
    body is from level is its attitude to the plane and the slope together.

    **Arguments** and attributes are those of `BodyBatch`, with one body for all seeds.
    """

    def __init__(self, body: Body, seeds: int, substeps: int = 10, threads: int = 0):
        check(not isinstance(body, Sequence), "body", body, "one body for all seeds")
        super().__init__(body, seeds, substeps, threads)

    def _bind(self) -> None:
        super()._bind()
        self._gravity = self._batch.expand("opt.gravity")
        self._level = np.array(self.model.opt.gravity)

    def step(self, activation: Any) -> None:
        """Advance every simulation by one decision.

        **Arguments:** `activation` (seeds, groups + 2): as `BodyBatch.step` takes it, and last the angle in rad at
        which the plane rises, and the direction in which it does, in rad from x towards y.
        """
        activation = np.asarray(activation)
        shape = (self.seeds, len(self.groups) + 2)
        check(activation.shape == shape, "activation.shape", activation.shape, f"(seeds, groups + 2) = {shape}")
        slope, ahead = activation[:, -2].astype(float), activation[:, -1].astype(float)
        size = np.linalg.norm(self._level)
        self._gravity[:, 0] = -size * np.sin(slope) * np.cos(ahead)
        self._gravity[:, 1] = -size * np.sin(slope) * np.sin(ahead)
        self._gravity[:, 2] = -size * np.cos(slope)
        super().step(activation[:, :-2])

    def reset(self, rows: Any = None) -> None:
        """Put simulations to the start pose, on a level plane; as `BodyBatch.reset`."""
        self._gravity[slice(None) if rows is None else rows] = self._level
        super().reset(rows)
