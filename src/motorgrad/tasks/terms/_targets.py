"""Targets of composed tasks: a place to reach, a pose to hold, a trajectory to follow."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check, shown_path
from motorgrad._limits import MAX_MOTION_BYTES
from motorgrad._reading import arrays_in, content_of, error_message, numbers_in
from motorgrad.bodies import BodyState
from motorgrad.schema import static
from motorgrad.tasks.terms._term import BoundTarget, Names, Numbers, Scene, Target, by_name, vector

REACHABLE = 2_048
"""Poses from which a place to reach is drawn."""
MAX_REACHABLE_POSES = 16_384
"""Poses of which those are taken that reach into a box."""
MAX_TRAJECTORY_NUMBERS = 100_000


class Reach(Target):
    """A place that sites, bodies or geoms should reach: a fixed one, one drawn in a box, or one that a random pose
    reaches."""

    parts: Names = by_name("hand", help="a name, or several")
    at: Numbers | None = vector(None, unit="m", help="a fixed place; three numbers for each part")
    low: Numbers | None = vector(None, unit="m", help="the lowest corner of the box from which it is drawn uniformly")
    high: Numbers | None = vector(
        None,
        unit="m",
        help="the highest corner. Without `at` or a box, the place is where the parts are in a pose whose "
        "`joints` are drawn uniformly in their ranges, so that it can be reached",
    )
    joints: Names = by_name("*", help="names or patterns of the joints of such poses")
    reachable: bool = static(False, help="whether places in the box are drawn only from those that such poses reach")

    def bind(self, scene: Scene) -> BoundTarget:
        parts = scene.parts(self.parts)
        points = [scene.point(name) for name in parts]
        shown = tuple(f"{name} {axis}" for name in parts for axis in "xyz")
        names = shown if len(parts) > 1 else tuple("xyz")
        size = len(names)
        if self.at is None and self.low is None and self.high is None:
            uniforms = 1
            draw = _one_of(_reached(scene, parts, self.joints, REACHABLE))
        elif self.reachable:
            _drawing(size, self.at, self.low, self.high)  # checks the box
            table = _reached(scene, parts, self.joints, MAX_REACHABLE_POSES)
            table = table[np.all((table >= np.array(self.low)) & (table <= np.array(self.high)), axis=1)]
            check(len(table), "low, high", (self.low, self.high), "a box that some pose reaches")
            uniforms = 1
            draw = _one_of(table)
        else:
            uniforms, draw = _drawing(size, self.at, self.low, self.high)
        return BoundTarget(
            names,
            uniforms,
            draw,
            _stays,
            lambda state: jnp.concatenate([point(state) for point in points]),
            marked=True,
            shown=shown,
            units="m",
        )


class Pose(Target):
    """Positions that joints should have: fixed ones, or drawn for each episode."""

    joints: Names = by_name("*", help="names or patterns, of hinges and slides")
    at: Numbers | None = vector(None, unit="rad or m", help="fixed positions, one for each joint")
    low: Numbers | None = vector(
        None, unit="rad or m", help="least positions; by default those of the joints' own ranges"
    )
    high: Numbers | None = vector(
        None, unit="rad or m", help="greatest positions, between which they are drawn uniformly"
    )

    def bind(self, scene: Scene) -> BoundTarget:
        names, places = scene.positions(self.joints)
        low, high = self.low, self.high
        if self.at is None and low is None and high is None:
            low, high = (tuple(each) for each in joint_ranges(scene, self.joints).T.tolist())
        uniforms, draw = _drawing(len(names), self.at, low, high)
        names = tuple(names)
        units = scene.position_units(places)
        return BoundTarget(
            names, uniforms, draw, _stays, lambda state: state.position[places], shown=names, units=units
        )


class Follow(Target):
    """A trajectory that sites or joints should follow, interpolated linearly between its moments. After its end it
    stays there, or starts again.

    It is given as `time` and `values`, or read once from a `file`: an NPZ file with arrays `time` and `values`, or a
    CSV file whose first column is the time in s, with or without a line of titles. A run keeps the numbers, and does
    not need the file again.
    """

    parts: Names = by_name((), help="names of sites, bodies or geoms whose places (m) are followed; or")
    joints: Names = by_name((), help="names or patterns of joints whose positions (rad or m) are followed")
    file: str | None = static(None, help="a path ending in .npz or .csv")
    time: Numbers = vector((), unit="s", help="increasing, from 0")
    values: tuple[Numbers, ...] = static(
        (), help="for each moment the numbers of all parts or joints, as one list after the other"
    )
    repeats: bool = static(False, help="whether it starts again at its end")
    random_start: bool = static(False, help="whether each episode starts at a random moment of it")

    def __post_init__(self) -> None:
        self.time = tuple(map(float, self.time))
        self.values = tuple(tuple(map(float, row)) for row in self.values)
        if self.file is not None:
            check(not self.time and not self.values, "file", self.file, "left out where time and values are given")
            self.time, self.values = _trajectory_in(Path(self.file))
            self.file = None

    def validate(self) -> None:
        _check_trajectory(self.time, self.values)
        check(bool(self.parts) != bool(self.joints), "parts, joints", (self.parts, self.joints), "one of the two")

    def bind(self, scene: Scene) -> BoundTarget:
        if self.joints:
            labels, places = scene.positions(self.joints)
            names = tuple(labels)
            units = scene.position_units(places)

            def actual(state: BodyState) -> Array:
                return state.position[places]

        else:
            parts = scene.parts(self.parts)
            points = [scene.point(name) for name in parts]
            names = tuple(f"{name} {axis}" for name in parts for axis in "xyz")
            units = ("m",) * len(names)

            def actual(state: BodyState) -> Array:
                return jnp.concatenate([point(state) for point in points])

        wide = len(self.values[0])
        check(wide == len(names), "values", f"{wide} numbers for each moment", f"{len(names)}: {', '.join(names)}")
        time = np.array(self.time, np.float32)
        values = np.array(self.values, np.float32)
        length = float(time[-1])

        def wanted(begun: Array, now: Array) -> Array:
            moment = begun + now
            moment = moment % length if self.repeats else jnp.minimum(moment, length)
            after = jnp.clip(jnp.searchsorted(time, moment, side="right"), 1, len(time) - 1)
            before = jnp.asarray(time)[after - 1]
            then = jnp.asarray(time)[after]
            part = (moment - before) / (then - before)
            return (1 - part) * jnp.asarray(values)[after - 1] + part * jnp.asarray(values)[after]

        placed = bool(self.parts)
        draw = (lambda uniforms: length * uniforms[0]) if self.random_start else lambda uniforms: jnp.zeros(())
        uniforms = int(self.random_start)
        again = self.time[-1] if self.repeats else 0.0
        return BoundTarget(names, uniforms, draw, wanted, actual, placed, True, length=again, units=units)


def joint_ranges(scene: Scene, joints: str | Sequence[str]) -> Float[np.ndarray, "joints 2"]:
    """The ranges of hinges and slides. **Raises** `ValueError` for a joint of another type, or without a range."""
    found = []
    for name in scene.named("joint", joints):
        joint = scene.model.joint(name)
        single = int(joint.type[0]) in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        limited = single and bool(scene.model.jnt_limited[joint.id])
        check(limited, "joint", name, "a hinge or slide with a range; or give low and high, or other joints")
        found.append(joint.range)
    return np.array(found)


def _reached(scene: Scene, parts: Sequence[str], joints: Names, poses: int) -> Float[np.ndarray, "poses numbers"]:
    """Where parts are in random poses."""
    model: Any = scene.model
    places = scene.positions(joints)[1]
    ranges = joint_ranges(scene, joints)
    data: Any = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    start = data.qpos.copy()
    found = np.zeros((poses, 3 * len(parts)), np.float32)
    kinds = {"SITE": "site_xpos", "GEOM": "geom_xpos", "XBODY": "xpos"}
    where = [
        (kinds[kind], getattr(model, "body" if kind == "XBODY" else kind.lower())(name).id)
        for kind, name in map(scene.place, parts)
    ]
    share = np.random.default_rng(0).random((poses, len(places)))
    for row, each in zip(found, ranges[:, 0] + share * (ranges[:, 1] - ranges[:, 0]), strict=True):
        data.qpos[:] = start
        data.qpos[places] = each
        mujoco.mj_kinematics(model, data)
        row[:] = np.concatenate([getattr(data, field)[number] for field, number in where])
    return found


def _one_of(table: np.ndarray) -> Callable[[Array], Array]:
    return lambda uniforms: jnp.asarray(table)[jnp.minimum((uniforms[0] * len(table)).astype(int), len(table) - 1)]


def _drawing(
    size: int, at: Numbers | None, low: Numbers | None, high: Numbers | None
) -> tuple[int, Callable[[Array], Array]]:
    """How many uniforms a draw takes, and the draw: a fixed place, or one in a box."""
    for name, given in (("at", at), ("low", low), ("high", high)):
        check(given is None or len(given) == size, name, given, f"{size} numbers")
    if at is not None:
        check(low is None and high is None, "low, high", (low, high), "left out where `at` is given")
        return 0, lambda uniforms: jnp.asarray(at, jnp.float32)
    check(low is not None and high is not None, "low, high", (low, high), "both given")
    corners = np.array((low, high), np.float32)
    check((corners[0] <= corners[1]).all(), "low, high", (low, high), "low <= high")
    least = jnp.asarray(corners[0])
    size_of = jnp.asarray(corners[1] - corners[0])
    return size, lambda uniforms: least + uniforms * size_of


def _stays(drawn: Array, time: Array) -> Array:
    del time
    return drawn


def _check_trajectory(time: Numbers, values: tuple[Numbers, ...]) -> None:
    count = len(time)
    rising = all(a < b for a, b in itertools.pairwise(time))
    fine = count >= 2 and time[0] == 0 and rising and all(map(math.isfinite, time))
    check(fine, "time", time, "at least two increasing times from 0 (s)")
    sizes = {len(row) for row in values}
    check(len(values) == count and len(sizes) == 1, "values", len(values), f"{count} lists of one length")
    finite = all(math.isfinite(value) for row in values for value in row)
    few = count * (1 + min(sizes)) <= MAX_TRAJECTORY_NUMBERS
    check(finite and few, "values", f"{count} moments", f"finite, and at most {MAX_TRAJECTORY_NUMBERS:,} numbers")


def _trajectory_in(file: Path) -> tuple[Numbers, tuple[Numbers, ...]]:
    check(file.is_file() and file.suffix in (".npz", ".csv"), "file", str(file), "an existing file, .npz or .csv")
    try:
        content = content_of(file, MAX_MOTION_BYTES)
        if file.suffix == ".npz":
            arrays = arrays_in(content, MAX_MOTION_BYTES)
            check({"time", "values"} <= set(arrays), "arrays", sorted(arrays), "time and values")
            time, values = (numbers_in(arrays[name], 8 * MAX_TRAJECTORY_NUMBERS) for name in ("time", "values"))
            check(time.ndim == 1 and values.ndim > 0, "time", time.shape, "a list of moments, with values for each")
        else:
            numbers = content.count(b",") + content.count(b"\n")
            check(numbers <= 2 * MAX_TRAJECTORY_NUMBERS, "numbers", numbers, f"at most {MAX_TRAJECTORY_NUMBERS:,}")
            lines = content.decode().strip().splitlines()
            titled = bool(lines) and not _numeric(lines[0])
            table = np.array([[float(word) for word in line.split(",")] for line in lines[titled:]])
            time = table[:, 0]
            values = table[:, 1:]
        check(len(time) == len(values) > 0, "moments", len(time), f"as many moments as rows of values, {len(values)}")
        moments = tuple(time.tolist())
        rows = tuple(tuple(row) for row in values.reshape(len(time), -1).tolist())
        _check_trajectory(moments, rows)
    except (ValueError, OSError, IndexError) as error:
        raise ValueError(f"file = {shown_path(file)}: {error_message(error)}") from None
    return moments, rows


def _numeric(line: str) -> bool:
    try:
        return bool([float(word) for word in line.split(",")])
    except ValueError:
        return False
