"""The figure of the natural gradient: a pool of motoneurons learns to fire as many units as its input asks for."""

import dataclasses
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.learning import Agent, FisherMetric, Olgarb, sgd
from motorgrad.tasks import Task
from motorgrad.worlds import World
from tools.figures._style import BLUE, RED, band, panels
from tools.figures._work import Work
from tools.figures.estimators import SEEDS

STEPS = 300_000


class Draws(World):
    """One number from U[0, 1) after the other."""

    uniforms = 1
    reset_uniforms = 1

    def reset(self, uniforms: Float[Array, " 1"]) -> Float[Array, " 1"]:
        return uniforms

    def step(self, state: Any, action: Array, uniforms: Float[Array, " 1"]) -> Float[Array, " 1"]:
        return uniforms


WORLD = Draws()


@dataclasses.dataclass(frozen=True)
class Counting(Task):
    """Section 4.3.1 of the thesis: so many of the units are to fire as 1.2 x - 0.1 says of them."""

    name: ClassVar[str] = "counting"
    units: int = 4

    @property
    def dynamics(self) -> World:
        return WORLD

    @property
    def observation_size(self) -> int:
        return 1

    @property
    def action_size(self) -> int:
        return self.units

    def init(self, uniforms: Float[Array, " 0"]) -> Any:
        return jnp.zeros(())

    def observe(self, memory: Any, state: Array, uniforms: Float[Array, " 0"]) -> tuple[Any, Array]:
        return state[0], state  # what is asked for is remembered until the reward

    def reward(self, memory: Any, state: Array, action: Array) -> tuple[Any, Array, bool]:
        return memory, -((jnp.sum(action) - self.units * (1.2 * memory - 0.1)) ** 2), False


def natural(work: Work) -> Figure:
    """Learning by the plain and by the natural gradient, in a small and in a larger pool."""
    figure, axes = panels(2)
    for panel, units in zip(axes, (4, 16), strict=True):
        task = Counting(units=units)
        start = mg.policies.motoneurons(task)
        for label, metric, rate, colour in (
            (r"plain, $\alpha$ = 2e-4", None, 2e-4, RED),
            (r"natural, $\alpha$ = 1e-4", FisherMetric(3e-4, {"threshold": 0.05}), 1e-4, BLUE),
        ):
            decisions, rewards = work.train(task, Agent(start, Olgarb(0.0), sgd(rate), metric), STEPS, SEEDS).curve()
            band(panel, decisions / 1000, -rewards, colour, label)
        panel.set(title=f"{units} motoneurons", xlabel="thousand decisions", yscale="log")
        panel.legend()
    axes[0].set_ylabel("mean squared error (units²)")
    return figure
