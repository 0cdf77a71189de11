"""The engine for bodies."""

import numpy as np
from jaxtyping import Float

from motorgrad.bodies import BodyBatch
from motorgrad.training._host_stepper import HostStepper


class BodyStepper(HostStepper):
    """Learning in a MuJoCo body: `HostStepper`, whose actions can be looked at."""

    batch: BodyBatch

    @property
    def activation(self) -> Float[np.ndarray, "seeds groups"]:
        """The actions under way: what each group of muscles does until the next decision."""
        return self._out[:, : len(self.batch.groups)]
