"""What composed tasks need beside their terms: bodies from settings, and units that drive actuators."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import collections
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, unknown
from motorgrad.bodies import BODIES, BUNDLED, Body, Mjcf
from motorgrad.schema import build, table
from motorgrad.tasks.terms import (
    Closeness,
    Distance,
    Effort,
    JointPositions,
    JointVelocities,
    RandomJoints,
    Reach,
    Scene,
    TargetError,
    TargetPosition,
    Within,
)

BodyLike = Body | str | Path | mujoco.MjSpec | Mapping[str, Any]
"""A body, or what `body_of` makes one of."""


class Drive(NamedTuple):
    """How units drive groups of actuators.

    `names` and `range` of the units; `matrix` from units to groups; the `rest` and the `limits` of each group; whether
    it is `plain`, so that each group has its own unit and range.
    """

    names: tuple[str, ...]
    range: Float[np.ndarray, "units 2"]
    matrix: Float[np.ndarray, "units groups"]
    rest: Float[np.ndarray, " groups"]
    limits: Float[np.ndarray, "groups 2"]
    plain: bool


def drive_of(scene: Scene, groups: Sequence[str | tuple[str, ...]] | None, binary: bool) -> Drive:
    """How the units of a task drive the actuators of its body, by `groups` or each its own.

    Several binary units may drive the same group, which is active while any of them is; from the second on, they have
    a number in their names.
    """
    limits = scene.control_range.astype(np.float32)
    rest = np.clip(np.zeros(len(limits), np.float32), *limits.T)
    if groups is None:
        driven = [(name, np.array([place])) for place, name in enumerate(scene.body.groups)]
    else:
        check(groups, "groups", groups, "at least one unit")
        named = [(each,) if isinstance(each, str) else each for each in groups]
        try:
            driven = [(" + ".join(each), scene.groups(each)) for each in named]
        except ValueError as error:
            raise ValueError(f"groups: {error}") from None
        check(binary or len(set(named)) == len(named), "groups", groups, "all different for continuous actions")
    if not driven:
        raise ValueError(f"{scene.body!r} has no muscles and no other actuators: it needs at least one to act")
    names: list[str] = []
    ranges = []
    rows = []
    before = collections.Counter[str]()
    for group, places in driven:
        before[group] += 1
        name = group if before[group] == 1 else f"{group} {before[group]}"
        row = np.zeros(len(limits), np.float32)
        if not binary:
            same = np.ptp(limits[places], axis=0).max() == 0
            check(same, f"groups: ranges of {name}", limits[places].tolist(), "the same for all actuators of one unit")
            row[places] = 1.0
            names = [*names, name]
            ranges = [*ranges, limits[places[0]]]
            rows = [*rows, row]
            continue
        for end, suffix in ((1, ""), (0, " backwards")):
            row = np.zeros(len(limits), np.float32)
            row[places] = limits[places, end] - rest[places]
            if row.any():
                names = [*names, name + suffix]
                ranges = [*ranges, (0.0, 1.0)]
                rows = [*rows, row]
    matrix = np.stack(rows)
    plain = groups is None and not binary
    base = rest if binary else np.where(matrix.any(axis=0), 0, rest).astype(np.float32)
    return Drive(tuple(names), np.array(ranges, np.float32), matrix, base, limits, plain)


def body_of(value: BodyLike) -> Body:
    """A body: itself; the path or text of an `Mjcf`, or a `mujoco.MjSpec`; the name of a body; or a table of one."""
    if isinstance(value, str) and value in BODIES:
        return BODIES[value]()
    if isinstance(value, str) and re.fullmatch(r"[\w-]*", value) and value not in BUNDLED:
        raise unknown("body", value, [*BODIES, *BUNDLED, "or the path of an MJCF file"])
    if isinstance(value, mujoco.MjSpec):
        return Mjcf(value)  # type: ignore[arg-type]
    if isinstance(value, str | Path):
        return build(Mjcf, {"source": value}, "body")
    if isinstance(value, Mapping):
        settings = dict(value)
        kind = settings.pop("kind", "mjcf")
        if kind not in BODIES:
            raise unknown("kind of body", kind, BODIES, registered=True)
        return build(BODIES[kind], settings, "body")
    check(hasattr(value, "spec") and hasattr(value, "groups"), "body", value, "a body, or the path of an MJCF file")
    return value


def body_table(body: Any) -> dict[str, Any]:
    """A body as a table with its kind, unless it is an `Mjcf`."""
    if isinstance(body, Mjcf):
        return table(body)
    names = [name for name, kind in BODIES.items() if kind is type(body)]
    return {"kind": names[0] if names else f"{type(body).__module__}.{type(body).__qualname__}", **table(body)}


def with_absolute_paths(settings: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Settings whose paths are meant from a folder. They are those of a model, files of terms, and the map of
    a terrain."""

    def walk(value: object, key: str = "") -> object:
        if isinstance(value, Mapping):
            return {name: walk(item, name) for name, item in value.items()}
        if isinstance(value, list | tuple):
            return [walk(item) for item in value]
        if not isinstance(value, str) or key not in ("body", "source", "file", "map"):
            return value
        if "<" in value or not Path(value).suffix:  # a document, or the name of a body
            return value
        return str(folder / value)

    return {name: walk(item, name) for name, item in settings.items()}


def reach() -> dict[str, Any]:
    """The task without a body: the arm that comes with the library reaches."""
    return {
        "body": Mjcf(),
        "observations": (JointPositions(), JointVelocities(), TargetPosition(), TargetError()),
        "rewards": (Distance(), Closeness(width=0.05), Effort(weight=-0.05)),
        "targets": (Reach("hand", low=(0.0, 0.25, 0.0), high=(0.3, 0.45, 0.0)),),
        "resets": (RandomJoints(share=0.5),),
        "metric_terms": (Distance(), Within(tolerance=0.03, name="solved")),
        "time_limit": 2.0,
    }
