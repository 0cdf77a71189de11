"""What a film of learning in the plane is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from motorgrad._errors import check
from motorgrad.sim._plane_units import shapes_of

if TYPE_CHECKING:
    from motorgrad.policies import Policy
    from motorgrad.tasks import ParticleTask


@dataclass(frozen=True, eq=False)
class Course:
    """A course of learning: what learners of a task on a particle earned, and the policy of one, at some moments.

    - `task`: on a particle.
    - `decision`: of each moment, rising.
    - `policies`: of the learner shown, the moments along a leading axis.
    - `reward`: mean per decision up to each moment, of every learner; NaN where there is none yet.
    - `shown`: the row of the learner shown.
    - `units`: how many units each learner has, where that changes; otherwise `None`.
    - `label`: what the learner shown is called.

    **Raises:** `ValueError` for arrays that do not fit together, and for units without a centre in the plane.
    """

    task: ParticleTask
    decision: Int[np.ndarray, " moments"]
    policies: Policy
    reward: Float[np.ndarray, "learners moments"]
    shown: int = 0
    units: Float[np.ndarray, "learners moments"] | None = None
    label: str = ""

    def __post_init__(self) -> None:
        count, shape = len(self.decision), self.reward.shape
        check(count > 0 and bool(np.all(np.diff(self.decision) > 0)), "decision", self.decision, "rising, at least one")
        check(shape[0] > 0 and shape[1:] == (count,), "reward", shape, f"of shape (learners, {count})")
        if self.units is not None:
            check(self.units.shape == shape, "units", self.units.shape, f"the reward's, {shape}")
        check(0 <= self.shown < shape[0], "shown", self.shown, f"a row of the reward, from 0 to {shape[0] - 1}")
        shapes_of(self.policy(0))  # refuses units that have no place in the plane

    def policy(self, moment: int) -> Policy:
        """The policy at one moment."""
        import jax

        return jax.tree.map(lambda leaf: np.asarray(leaf[moment]), self.policies)
