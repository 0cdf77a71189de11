"""The biomimetic hexapod with other feet and other front legs, and how it walks."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
import dataclasses
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from motorgrad.bodies import LEGS, Hexapod, Hinge, LegState, OnTerrain, Terrain, Walk, walk
from motorgrad.experiments.chapter_5.hexapod._walk_record import TOUCH

START = 2.0  # s
FRONT = [LEGS.index(leg) for leg in LEGS if leg.endswith("front")]
BEHIND = [number for number in range(len(LEGS)) if number not in FRONT]


def with_friction(body: Hexapod, sections: Sequence[str], friction: float) -> Hexapod:
    """The same hexapod with another friction of the feet of some sections."""
    changed = {name: body.sections[name] for name in sections}
    return dataclasses.replace(
        body,
        **{
            name: dataclasses.replace(section, leg=dataclasses.replace(section.leg, friction=friction))
            for name, section in changed.items()
        },
    )


def with_low_front(body: Hexapod, highest: float) -> Hexapod:
    """The same hexapod with front legs that rise to an angle in degrees and no further."""
    leg = body.front.leg
    hinge = Hinge((leg.vertical.range[0], highest), leg.vertical.stiffness, leg.vertical.damping)
    return dataclasses.replace(
        body, front=dataclasses.replace(body.front, leg=dataclasses.replace(leg, vertical=hinge))
    )


def walked(body: Hexapod, height: float, seeds: int, seconds: float, threads: int) -> dict[str, Any]:
    """How a hexapod walks over bumps, each seed on its own, once it has started; (seeds,) each.

    **Returns** by name: `speed` along the heading and `net` displacement over time, m/s; `slip`, the speed at which
    the middle and rear feet slide while they are on the ground, m/s; `early`, the part of the front legs' swing in
    which they touch the ground; `yaw`, the root mean square of the yaw rate, rad/s.
    """
    grounds = [OnTerrain(body, Terrain("bumps", height=height, seed=seed)) for seed in range(seeds)]
    found = walk(grounds, seconds=seconds + START, threads=threads)
    late, gait = found.time > START, found.gait(since=START)
    contact, swing = found.reading.contact[late] > TOUCH, found.states[late] == LegState.SWING
    early = (contact & swing)[:, :, FRONT].sum((0, 2)) / np.maximum(swing[:, :, FRONT].sum((0, 2)), 1)
    return {
        "speed": gait.speed,
        "net": gait.net,
        "slip": slip(found, body, BEHIND)[late[1:]].mean(0),
        "early": early,
        "yaw": np.sqrt((found.reading.yaw_rate[late] ** 2).mean(0)),
    }


def slip(found: Walk, body: Hexapod, legs: Sequence[int]) -> np.ndarray:
    """How fast feet slide over the ground between two decisions at which they touch it, the mean of those that do, 0
    where none does, (decisions − 1, seeds) in m/s."""
    contact = found.reading.contact[:, :, list(legs)] > TOUCH
    both = contact[1:] & contact[:-1]
    moved = np.diff(_soles(found, body, legs)[..., :2], axis=0)
    speed = np.linalg.norm(moved, axis=-1) / found.period
    return (speed * both).sum(-1) / np.maximum(both.sum(-1), 1)


def _soles(found: Walk, body: Hexapod, legs: Sequence[int]) -> np.ndarray:
    """Where the feet end, (decisions, seeds, legs, 3) in m."""
    names = [LEGS[number] for number in legs]
    along = np.array([[body.sections[name.partition("_")[2]].leg.foot.length, 0.0, 0.0] for name in names])
    ends = np.empty((*found.posture.shape[:2], len(names), 3))
    for seed, model in enumerate(found.models):
        data = mujoco.MjData(model)
        feet = [model.body(f"foot_{name}").id for name in names]
        for decision, posture in enumerate(found.posture[:, seed]):
            data.qpos[:] = posture
            mujoco.mj_kinematics(model, data)
            turned = np.einsum("lij,lj->li", data.xmat[feet].reshape(-1, 3, 3), along)
            ends[decision, seed] = data.xpos[feet] + turned
    return ends
