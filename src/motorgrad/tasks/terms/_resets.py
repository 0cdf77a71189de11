"""Where the body of a composed task begins an episode."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

from typing import Any

import numpy as np

from motorgrad._errors import check, unknown
from motorgrad._random import MIN_UNIFORM
from motorgrad.schema import number, static
from motorgrad.tasks.terms._targets import joint_ranges
from motorgrad.tasks.terms._term import BoundReset, Names, Numbers, Reset, Scene, Start, by_name, vector


class Keyframe(Reset):
    """Start in a keyframe of the model, with its positions, velocities and activations, or in one of several, drawn for
    each episode."""

    names: tuple[str, ...] = static((), help="names of the keyframes; by default all")

    def bind(self, scene: Scene) -> BoundReset:
        model = scene.model
        known = [model.key(i).name for i in range(model.nkey)]
        for name in self.names:
            if name not in known:
                raise unknown("keyframe", name, known)
        check(known, "keyframes of the model", known, "at least one")
        which = [known.index(name) for name in self.names] or list(range(len(known)))
        keys = Start(*(np.array(each)[which] for each in (model.key_qpos, model.key_qvel, model.key_act)))

        def apply(start: Start, uniforms: np.ndarray) -> Start:
            share = uniforms[:, 0] if len(which) > 1 else np.zeros(len(start.position))
            chosen = np.minimum((share * len(which)).astype(int), len(which) - 1)
            return Start(*(each[chosen] for each in keys))

        return BoundReset(int(len(which) > 1), apply)


class RandomJoints(Reset):
    """Start with joints at random positions."""

    joints: Names = by_name("*", help="names or patterns, of hinges and slides")
    low: Numbers | None = vector(
        None, unit="rad or m", help="least positions; by default those of the joints' own ranges"
    )
    high: Numbers | None = vector(
        None, unit="rad or m", help="greatest positions, between which they are drawn uniformly"
    )
    share: float = number(1.0, 0, 1, help="the part of that range, about its middle, in which they are drawn")

    def bind(self, scene: Scene) -> BoundReset:
        names, places = scene.positions(self.joints)
        given = self.low is not None or self.high is not None
        ends: Any = (self.low, self.high) if given else tuple(joint_ranges(scene, self.joints).T.tolist())
        fine = all(end is not None and len(end) == len(names) for end in ends)
        check(fine, "low, high", ends, f"{len(names)} numbers each, for {', '.join(names)}")
        low, high = np.array(ends, float)
        check((low <= high).all(), "low, high", ends, "low <= high")
        middle = (low + high) / 2
        half = self.share * (high - low) / 2

        def apply(start: Start, uniforms: np.ndarray) -> Start:
            start.position[:, places] = middle + (2 * uniforms - 1) * half
            return start

        return BoundReset(len(names), apply)


class Noise(Reset):
    """Add normal noise to the positions and velocities of joints. Positions stay in the joints' ranges."""

    joints: Names = by_name("*", help="names or patterns, of hinges and slides")
    position: float = number(0.0, 0, unit="rad or m", help="standard deviation of the noise of positions")
    velocity: float = number(0.0, 0, unit="rad/s or m/s", help="standard deviation of the noise of velocities")

    def bind(self, scene: Scene) -> BoundReset:
        from scipy.special import ndtri  # loading it would slow down every command's start

        names, places = scene.positions(self.joints)
        speeds = scene.velocities(self.joints)[1]
        check(len(places) == len(speeds), "joints", names, "hinges and slides")
        model = scene.model
        size = len(places)
        joints = [model.joint(name).id for name in names]
        limited = np.array(model.jnt_limited, bool)[joints]
        low, high = np.where(limited[:, None], np.array(model.jnt_range)[joints], (-np.inf, np.inf)).T
        deviation, fast = self.position, self.velocity

        def apply(start: Start, uniforms: np.ndarray) -> Start:
            normal = ndtri(np.maximum(uniforms, MIN_UNIFORM))
            start.position[:, places] = np.clip(start.position[:, places] + deviation * normal[:, :size], low, high)
            start.velocity[:, speeds] += fast * normal[:, size:]
            return start

        return BoundReset(2 * size, apply)
