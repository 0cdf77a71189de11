"""Frozen hoppers that are pushed to the side in every flight, with flexors as learned or not: the angle of the foot at
every landing, and the hop that follows; and the fall of a hopper that leans."""

import itertools
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from motorgrad import bodies
from motorgrad.bodies import PushBatch
from motorgrad.tasks import Hopper
from motorgrad.training import Run
from motorgrad_thesis._experiment import Values
from motorgrad_thesis.chapter_5._hopper_study import posture
from motorgrad_thesis.chapter_5.figure_5_4 import FLEXOR

Rule = Literal["learned", "falling off", "flight off", "falling on"]
RULES: tuple[Rule, ...] = ("learned", "falling off", "flight off", "falling on")
"""What the flexors do: what the policy decides; but nothing while the load falls in flight; nothing in flight; or
contract all the time while it falls."""

FALLS = ("lean", "gust")
"""What disturbs a fall: the body leans when it is dropped, or a gust pushes its foot."""
LAST = 0.1
"""Seconds before landing over which the angle of a fall is averaged, so that the phase of its swing matters less."""

Numbers = Float[np.ndarray, "steps seeds"]
Flags = Bool[np.ndarray, "steps seeds"]


def pushed_hops(task: Hopper, run: Run, seconds: float, rule: Rule, calm: bool = False) -> Values:
    """What frozen policies do on a task with gusts, or without them where it is `calm`. Under every rule the same
    hopper meets the same gusts, flight by flight, and its units draw the same random numbers.

    **Returns** for each seed, `(seeds,)`, what `landings` does; and `flexes`, the share of the decisions in the fall at
    which the flexors are active.
    """
    # every millisecond is watched, and larger batches gain from threads
    batch = PushBatch(task.body, len(run.seeds), substeps=1, threads=1, part="foot")
    decisions = round(seconds / task.period)
    draws = [np.random.default_rng([seed, 5, 2, 2]) for seed in run.seeds]
    chance = np.stack([draw.random((decisions, task.action_size)) for draw in draws], axis=1)
    gusts = np.stack([draw.random(decisions) for draw in draws], axis=1).astype(np.float32)
    policies: Any = run.policies
    memory = jax.vmap(task.init)(jnp.zeros((len(run.seeds), 0)))

    @jax.jit
    def decide(memory: Any, packed: Any, number: Any) -> Any:
        memory, seen = jax.vmap(task.observe)(memory, batch.unpack(packed), number[:, None])
        return memory, jax.vmap(lambda policy, each: policy.prob(each))(policies, seen)

    lanes = np.arange(len(run.seeds))
    flights = np.zeros(len(run.seeds), int)
    up = np.zeros(len(run.seeds), bool)
    angle = []
    height = []
    contact = []
    fallen = []
    flexed = []
    for decision in range(decisions):
        state = batch.unpack(batch.packed)
        air = ~(state.sensors["foot_contact"] > 0)
        flights += air & ~up
        up = air
        memory, shares = decide(memory, batch.packed.copy(), gusts[flights, lanes])
        firing = chance[decision] < np.asarray(shares)
        falling = air & (state.velocity[:, 0] < 0)
        firing[:, FLEXOR] = _ruled(rule, firing[:, FLEXOR], air, falling)
        control = np.array(task.control(firing.astype(np.float32), memory))
        control[:, -1] *= not calm
        fallen.append(falling)
        flexed.append(firing[:, FLEXOR])
        for _ in range(task.substeps):
            batch.step(control)
            state = batch.unpack(batch.packed)
            angle.append(np.degrees(state.position[:, 1:4].sum(axis=1)))
            height.append(state.sensors["foot_height"].copy())
            contact.append(state.sensors["foot_contact"] > 0)
    falls = np.stack(fallen)
    return {
        **landings(np.stack(angle), np.stack(height), np.stack(contact), task),
        "flexes": np.sum(falls & np.stack(flexed), axis=0) / np.maximum(falls.sum(axis=0), 1),
    }


def _ruled(rule: Rule, learned: np.ndarray, air: np.ndarray, falling: np.ndarray) -> np.ndarray:
    """Which flexors contract."""
    if rule == "falling off":
        return learned & ~falling
    if rule == "flight off":
        return learned & ~air
    return learned | falling if rule == "falling on" else learned


def landings(angle: Numbers, height: Numbers, contact: Flags, task: Hopper) -> Values:
    """How hoppers land in a motion, given at every time step of the physics: the foot's angle in degrees, its height in
    m, and whether it touches the ground.

    **Returns** for each seed, `(seeds,)`, 0 for one with fewer than three hops: `angle`, rms of the foot's angle
    against the ground at the end of its hops, in degrees; `height`, the mean height of its hops in m; `loss`, by how
    much a hop is lower for every degree at the landing before it, in m.
    """
    found = np.zeros((3, angle.shape[1]))
    for seed in range(angle.shape[1]):
        ends, heights = _hops(height[:, seed], contact[:, seed], task.hop_height)
        if len(ends) > 2:
            tilt = angle[ends - 1, seed]
            slope = np.polyfit(np.abs(tilt[:-1]), heights[1:], 1)[0]
            found[:, seed] = np.sqrt(np.mean(tilt**2)), heights.mean(), -slope
    return dict(zip(("angle", "height", "loss"), found, strict=True))


def _hops(height: np.ndarray, contact: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """The steps at which flights above `least` touch the ground again, and their greatest heights, `(hops,)` each."""
    edges = np.flatnonzero(np.diff(contact.astype(int))) + 1
    flights = [(leaves, lands) for leaves, lands in itertools.pairwise(edges) if not contact[leaves]]
    highest = np.array([height[leaves:lands].max() for leaves, lands in flights])
    lands = np.array([lands for _, lands in flights], int)
    return lands[highest > least], highest[highest > least]


def leaning_falls(body: bodies.Hopper, drop: float, lean: float, gust: float) -> Values:
    """The foot's angle while a hopper falls from rest with its knees at 90°, with silent and with active flexors.

    **Arguments:** `drop`, the height of the sole in m; `lean`, in degrees, at the start of the first fall, or `gust`,
    in N, during the second.

    **Returns** `time` `(steps,)` in s; `fall` `(2, 2, steps)` in degrees, by `FALLS`, then silent or active flexors,
    NaN once the foot is down; `landing` `(2, 2)`, rms of the last `LAST` seconds of it.
    """
    batch = PushBatch(body, 4, substeps=1, threads=1, part="foot")
    start = np.tile(posture(body, np.pi / 2), (4, 1))
    start[:, 0] += drop
    start[:2, 1] += np.radians(lean)
    start[:2, 4] -= np.radians(lean)
    batch.reset(position=start)
    control = np.zeros((4, 3))
    control[1::2, FLEXOR] = 1.0
    control[2:, -1] = gust
    steps = round(2.0 * np.sqrt(2.0 * drop / 9.81) / body.timestep)
    angles = np.full((4, steps), np.nan)
    falling = np.ones(4, bool)
    for step in range(steps):
        state = batch.unpack(batch.packed)
        falling &= ~(state.sensors["foot_contact"] > 0)
        angles[falling, step] = np.degrees(state.position[falling, 1:4].sum(axis=1))
        batch.step(control)
    landed = (~np.isnan(angles)).sum(axis=1)
    last = [trace[:end][-round(LAST / body.timestep) :] for trace, end in zip(angles, landed, strict=True)]
    return {
        "time": body.timestep * np.arange(steps),
        "fall": angles.reshape(2, 2, steps),
        "landing": np.reshape([np.sqrt(np.mean(each**2)) for each in last], (2, 2)),
    }
