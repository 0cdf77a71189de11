"""Bodies that are pushed to the side while they move."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from motorgrad._errors import check, unknown
from motorgrad.bodies._batch import BodyBatch
from motorgrad.bodies._body import Body


class PushBatch(BodyBatch):
    """Simulations in which a force along x acts on one part of the body, which can change at every decision,
    independently for each seed.

    **Arguments** and attributes are those of `BodyBatch`; and `part`, the name of the part, at whose centre of mass the
    force acts.

    **Raises:** `ValueError` for an unknown part.
    """

    def __init__(self, body: Body | Sequence[Body], seeds: int, substeps: int = 10, threads: int = 0, *, part: str):
        super().__init__(body, seeds, substeps, threads)
        names = [self.model.body(number).name for number in range(1, self.model.nbody)]
        if part not in names:
            raise unknown("part", part, names)
        self._part = 1 + names.index(part)
        self._force = np.zeros((self.seeds, 3))

    def step(self, control: npt.ArrayLike) -> None:
        """Advance every simulation by one decision.

        **Arguments:** `control` (seeds, groups + 1): as in `BodyBatch.step`; the last column is the force in N.
        """
        control = np.asarray(control)
        shape = (self.seeds, len(self.groups) + 1)
        check(control.shape == shape, "control.shape", control.shape, f"(seeds, groups + 1) = {shape}")
        self._force[:, 0] = control[:, -1]
        self.push(self._part, self._force)
        super().step(control[:, :-1])
