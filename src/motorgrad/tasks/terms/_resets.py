"""Where the body of a composed task begins an episode."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

from typing import Any

import numpy as np
from scipy.special import ndtri

from motorgrad._errors import check, unknown
from motorgrad._tree import number, static
from motorgrad.tasks.terms._targets import joint_ranges
from motorgrad.tasks.terms._term import BoundReset, Names, Numbers, Pose, Reset, Scene, by_name, vector

LEAST = 2.0**-24  # replaces a uniform number of 0, whose normal quantile is −∞


class Keyframe(Reset):
    """Begin in a keyframe of the model, or in one of several, drawn for each episode.

    **Arguments:**

    - `names`: names of the keyframes; by default all.
    """

    names: tuple[str, ...] = static(())

    def bind(self, scene: Scene) -> BoundReset:
        model = scene.model
        known = [model.key(i).name for i in range(model.nkey)]
        for name in self.names:
            if name not in known:
                raise unknown("keyframe", name, known)
        check(known, "keyframes of the model", known, "at least one")
        which = [known.index(name) for name in self.names] or list(range(len(known)))
        positions, velocities = np.array(model.key_qpos)[which], np.array(model.key_qvel)[which]

        def apply(position: np.ndarray, velocity: np.ndarray, uniforms: np.ndarray) -> Pose:
            chosen = np.zeros(len(position), int) if len(which) == 1 else _floor(uniforms[:, 0], len(which))
            return positions[chosen], velocities[chosen]

        return BoundReset(int(len(which) > 1), apply)


class RandomJoints(Reset):
    """Begin with joints at random positions.

    **Arguments:**

    - `joints`: names or patterns, of hinges and slides.
    - `low` (rad or m): least positions; by default those of the joints' own ranges.
    - `high` (rad or m): greatest positions, between which they are drawn uniformly.
    - `share`: of that range about its middle, from 0 to 1.
    """

    joints: Names = by_name("*")
    low: Numbers | None = vector(None)
    high: Numbers | None = vector(None)
    share: float = number(1.0, 0, 1)

    def bind(self, scene: Scene) -> BoundReset:
        names, places = scene.positions(self.joints)
        given = self.low is not None or self.high is not None
        ends: Any = (self.low, self.high) if given else tuple(joint_ranges(scene, self.joints).T.tolist())
        fine = all(end is not None and len(end) == len(names) for end in ends)
        check(fine, "low, high", ends, f"{len(names)} numbers each, for {', '.join(names)}")
        low, high = np.array(ends, float)
        check((low <= high).all(), "low, high", ends, "low <= high")
        middle, half = (low + high) / 2, self.share * (high - low) / 2

        def apply(position: np.ndarray, velocity: np.ndarray, uniforms: np.ndarray) -> Pose:
            position[:, places] = middle + (2 * uniforms - 1) * half
            return position, velocity

        return BoundReset(len(names), apply)


class Noise(Reset):
    """Add normal noise to the positions and velocities of joints. Positions stay in the joints' ranges.

    **Arguments:**

    - `joints`: names or patterns, of hinges and slides.
    - `position` (rad or m): standard deviation of the noise of positions.
    - `velocity` (rad/s or m/s): standard deviation of the noise of velocities.
    """

    joints: Names = by_name("*")
    position: float = number(0.0, 0)
    velocity: float = number(0.0, 0)

    def bind(self, scene: Scene) -> BoundReset:
        names, places = scene.positions(self.joints)
        speeds = scene.velocities(self.joints)[1]
        check(len(places) == len(speeds), "joints", names, "hinges and slides")
        model, size = scene.model, len(places)
        joints = [model.joint(name).id for name in names]
        limited = np.array(model.jnt_limited, bool)[joints]
        low, high = np.where(limited[:, None], np.array(model.jnt_range)[joints], (-np.inf, np.inf)).T
        deviation, fast = self.position, self.velocity

        def apply(position: np.ndarray, velocity: np.ndarray, uniforms: np.ndarray) -> Pose:
            normal = ndtri(np.maximum(uniforms, LEAST))
            position[:, places] = np.clip(position[:, places] + deviation * normal[:, :size], low, high)
            velocity[:, speeds] += fast * normal[:, size:]
            return position, velocity

        return BoundReset(2 * size, apply)


def _floor(uniforms: np.ndarray, count: int) -> np.ndarray:
    return np.minimum((uniforms * count).astype(int), count - 1)
