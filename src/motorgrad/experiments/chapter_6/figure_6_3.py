"""Figure 6.3: the policy of the particle as a diagram, and how few distinct forces its units make up."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim, exact
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_6._policy_diagram import draw_policy
from motorgrad.tasks import FallingParticle
from motorgrad.worlds import ParticleState

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAME = 1e-5  # velocities that are closer are of one force


@dataclasses.dataclass(frozen=True)
class ParticlePolicy(Experiment):
    """The particle and its policy as a loop. The place of the particle reaches all units of a plastic, stochastic
    layer; those that fire switch on a fixed force each, which add up. The reward is a function of the place. Of all
    firing patterns the world itself says how many distinct motions they lead to.

    **Arguments:**

    - `most`: forces to each side, up to which firing patterns are counted.
    """

    name: ClassVar[str] = "fig-6.3"
    title: ClassVar[str] = "the particle's policy"
    source: ClassVar[str] = "figure 6.3"

    most: int = 6

    def __post_init__(self) -> None:
        check(1 <= self.most <= 8, "most", self.most, "in 1 … 8 forces to each side")

    @classmethod
    def quick(cls) -> Self:
        return cls(most=3)

    def run(self, work: Workspace) -> Values:
        del work
        sides = np.arange(1, self.most + 1)
        counted = [motions(int(side)) for side in sides]
        return {
            "sides": sides,
            "patterns": np.array([count for count, _ in counted]),
            "motions": np.array([count for _, count in counted]),
        }

    def figure(self, values: Values) -> "Figure":
        return draw_policy()

    def claims(self, values: Values) -> Sequence[Claim]:
        sides = values["sides"]
        last = int(sides[-1])
        return [
            Claim(
                f"N forces to each side have 2^(2N) firing patterns (N from 1 to {last}).",
                "section 6.3",
                f"for N = {last}: {4**last:,}; for each N exactly",
                exact(values["patterns"][-1]),
                np.array_equal(values["patterns"], 4**sides),
                "patterns",
            ),
            Claim(
                f"They make only 2N + 1 distinct actions (N from 1 to {last}).",
                "section 6.3",
                f"distinct velocities after one decision, for N = {last}: {2 * last + 1}; for each N exactly",
                exact(values["motions"][-1]),
                np.array_equal(values["motions"], 2 * sides + 1),
                "actions",
                "Counted in the world itself, from rest in the middle of the box.",
            ),
        ]


def motions(side: int) -> tuple[int, int]:
    """How many firing patterns there are with so many forces to each side, and to how many velocities they lead."""
    world = FallingParticle(units=2 * side).dynamics
    codes = np.arange(4**side)[:, None] >> np.arange(2 * side)
    rest = ParticleState(jnp.full(2, 0.5), jnp.zeros(2), jnp.zeros(4, bool))
    patterns = jnp.asarray(codes & 1, jnp.float32)
    moved = jax.vmap(lambda action: world.step(rest, action, jnp.zeros(world.uniforms)).velocity)(patterns)
    speeds = np.sort(np.asarray(moved)[:, 0])
    return len(patterns), 1 + int((np.diff(speeds) > SAME).sum())
