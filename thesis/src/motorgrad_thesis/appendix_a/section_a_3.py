"""Appendix A.3: collisions whose times are found by going back and halving, against putting the particle on the
wall."""

import math
from collections.abc import Iterator
from typing import Any, Literal, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from motorgrad.schema import count
from motorgrad.statistics import exact, mean_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import agent_for
from motorgrad.worlds import Particle, ParticlePhysics, ParticleState, Walls
from motorgrad_thesis._claims import Claim, at_most, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, subplots
from motorgrad_thesis.chapter_6._local_study import frozen_reward, late_reward

Collisions = Literal["reposition", "bisection"]
KINDS = get_args(Collisions)
COLOURS = {"reposition": "#c8452f", "bisection": "#3b6fb6"}
LABELS = {"reposition": "put on the wall", "bisection": "time found by halving"}
GRAVITY = 0.25  # as of the falling particle
HEIGHT = 0.9
BOUNCE = 0.8  # restitution of the drawing, of which several rebounds are seen
SECONDS = 14.0
SMALL = 0.05  # of the reward: differences below are small
CLOSE = 1e-4  # of the side of the box: single precision over some hundred steps
FROZEN = 5_000  # decisions in which a learned policy is judged
SMOOTH = 10  # records of a moving average


@experiment("sec-a.3-collisions", "the time of a collision", "section A.3")
class CollisionTimes(Experiment):
    """Two ways to treat a particle that is beyond a wall after a time step: it is put on the wall, or the step is taken
    back and the time of the collision found by halving. Left: a ball that bounces without drag, and its closed form.
    Middle: the error of its height. Right: learning curves of the falling particle with either.
    """

    decisions: int = count(50_000, 1_000, 10**8, help="number of decisions of learning; 50,000 contain 2,000 episodes")
    seeds: int = count(20, 2, 10_000, help="number of learners with either kind of collision")

    quick = smoke(decisions=2_000, seeds=3)

    def run(self, work: Workspace) -> Values:
        times, heights = bounces(HEIGHT, GRAVITY, BOUNCE, SECONDS)
        found: Values = {"time": times, "closed form": heights}
        learned: Any = None
        for kind in KINDS:
            found[f"{kind} height"] = bounced(kind)
            task = falling(kind)
            run = work.train(task, agent_for(task), self.decisions, self.seeds)
            found[f"{kind} decisions"], found[f"{kind} curve"] = run.curve()
            found[f"{kind} late"] = late_reward(run)
            learned = run.policies if kind == "reposition" else learned
        for kind in KINDS:  # what was learned with the one, in the other world and in its own
            found[f"in {kind}"] = frozen_reward(work, falling(kind), learned, FROZEN)
        return found

    def figure(self, values: Values) -> Figure:
        figure, (left, middle, right) = subplots(13, 3.9, columns=3)
        left.plot(values["time"], values["closed form"], color="0.75", linewidth=4, label="closed form")
        for kind in KINDS:
            height = values[f"{kind} height"]
            left.plot(values["time"], height, color=COLOURS[kind], label=LABELS[kind])
            error = np.maximum(np.abs(height - values["closed form"]), 1e-8)
            middle.plot(values["time"], error, color=COLOURS[kind])
            curve = values[f"{kind} curve"]
            records = min(SMOOTH, curve.shape[1])
            draw_band(right, values[f"{kind} decisions"] / 1000, curve, COLOURS[kind], LABELS[kind], records=records)
        left.set(xlabel="time (s)", ylabel="height", title="a ball that bounces", ylim=(0, 1.3 * HEIGHT))
        middle.set(xlabel="time (s)", ylabel="error of the height", yscale="log", title="distance to the closed form")
        right.set(xlabel="decisions (thousands)", ylabel="reward per decision", title="learning to fall")
        left.legend(loc="upper right", fontsize=9)
        right.legend(loc="lower right", fontsize=9)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        errors = {kind: float(np.abs(values[f"{kind} height"] - values["closed form"]).max()) for kind in KINDS}
        mean = float(values["bisection late"].mean())
        yield within(
            -SMALL,
            SMALL,
            ACCEPTABLE,
            mean_of((values["reposition late"] - values["bisection late"]) / mean),
            "difference of the reward, as a share",
            of=ACCEPTABLE,
            note=f"After {self.decisions:,} decisions in R1; {self.seeds} seeds with the same random numbers. With the "
            f"time found by halving: {mean:.3g} per decision.",
        )
        ours = values["in reposition"]
        yield within(
            -SMALL,
            SMALL,
            "A policy learned with the particle put on the wall earns as much where times are found by halving.",
            mean_of((ours - values["in bisection"]) / ours.mean()),
            "difference of the reward, as a share",
            of=ACCEPTABLE,
            note=f"Without learning, over {FROZEN:,} decisions of each policy with the same random numbers.",
        )
        yield at_most(
            CLOSE,
            "With the times found by halving, a ball that bounces follows the closed form.",
            exact(errors["bisection"]),
            "greatest error of the height",
            kind="extension",
            note=f"In {SECONDS:g} s, a restitution of {BOUNCE:g} and no drag; put on the wall, the ball is off by up "
            f"to {errors['reposition']:.2g} of the box.",
        )


ACCEPTABLE = "For the low velocities used it is acceptable to put the particle on the boundary."


def falling(kind: Collisions) -> FallingParticle:
    """The falling particle in the first layout."""
    return FallingParticle(layout="R1", physics=ParticlePhysics(collisions=kind))


def bounced(kind: Collisions) -> Float[np.ndarray, " steps"]:
    """Heights of a ball that bounces without drag, at the start and after every time step."""
    physics = ParticlePhysics(
        gravity=(0.0, -GRAVITY), drag=0.0, substeps=1, walls=Walls(restitution=BOUNCE), collisions=kind
    )
    world = Particle(((1.0, 0.0),), physics)
    start = ParticleState(jnp.array([0.5, HEIGHT]), jnp.zeros(2), jnp.zeros(4, bool))

    def step(state: Any, _: None) -> tuple[Any, Any]:
        after = world.step(state, jnp.zeros(1), jnp.zeros(world.uniforms))
        return after, after.position[1]

    heights = jax.lax.scan(step, start, length=round(SECONDS / physics.timestep))[1]
    return np.concatenate([[HEIGHT], np.asarray(heights, float)])


def bounces(
    height: float, gravity: float, restitution: float, seconds: float
) -> tuple[Float[np.ndarray, " steps"], Float[np.ndarray, " steps"]]:
    """The times of all time steps, and the exact heights of a ball that is dropped and bounces without drag."""
    times = np.arange(round(seconds / ParticlePhysics().timestep) + 1) * ParticlePhysics().timestep
    heights = height - 0.5 * gravity * times**2
    hit = math.sqrt(2.0 * height / gravity)
    speed = restitution * gravity * hit
    while hit < seconds:
        since = times - hit
        heights = np.where(since > 0.0, speed * since - 0.5 * gravity * since**2, heights)
        hit += 2.0 * speed / gravity
        speed *= restitution
    return times, heights
