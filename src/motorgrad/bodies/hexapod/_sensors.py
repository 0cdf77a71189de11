"""The hexapod's sensors."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

from collections.abc import Iterable
from typing import Any, NamedTuple

import mujoco

from motorgrad._arrays import AnyArray
from motorgrad.bodies._batch import BodyState
from motorgrad.bodies._body import add_sensors

LEGS = tuple(f"{side}_{section}" for side in ("left", "right") for section in ("front", "middle", "rear"))
"""The names of a hexapod's legs in the order of all arrays: left legs first, front to rear."""

SECTIONS = ("front", "middle", "rear")


class HexapodReading(NamedTuple):
    """A hexapod's sensor readings, as NumPy or JAX arrays with any leading axes. Legs are in the order of `LEGS`.

    - `lateral`, `vertical` (..., 6): angles in rad, positive forward and up; `lateral_velocity`, `vertical_velocity`
      (..., 6) in rad/s.
    - `contact` (..., 6), `belly` (...): normal forces on the feet, and on all three sections together, N.
    - `position` (..., 3): position of the middle section's centre, m.
    - `heading` (...): heading of the middle section, rad in [−π, π] from x towards y; `yaw_rate` (...) in rad/s.
    - `speed` (...): horizontal velocity of the middle section along its heading, m/s.
    - `upright` (...): z component of the middle section's upward axis, from 1, level, to −1, overturned.
    """

    lateral: Any
    lateral_velocity: Any
    vertical: Any
    vertical_velocity: Any
    contact: Any
    belly: Any
    position: Any
    heading: Any
    yaw_rate: Any
    speed: Any
    upright: Any


def read_hexapod(state: BodyState) -> HexapodReading:
    """Read a hexapod's state by meaning, with slicing and a little trigonometry only (NumPy, JAX, tracers)."""
    sensors = state.sensors
    xp = state.position.__array_namespace__()

    def legs(kind: str, of: Iterable[str] = LEGS, suffix: str = "") -> Any:
        return xp.stack([sensors[f"{kind}_{leg}{suffix}"] for leg in of], axis=-1)

    ahead = sensors["forward"]
    velocity = sensors["velocity"]
    x = ahead[..., 0]
    y = ahead[..., 1]
    return HexapodReading(
        lateral=legs("lateral"),
        lateral_velocity=legs("lateral", suffix="_velocity"),
        vertical=legs("vertical"),
        vertical_velocity=legs("vertical", suffix="_velocity"),
        contact=legs("contact"),
        belly=xp.sum(legs("belly", SECTIONS), axis=-1),
        position=sensors["position"],
        heading=xp.arctan2(y, x),
        yaw_rate=sensors["rotation"][..., 2],
        # a trunk that points straight up has no heading, so no speed along it
        speed=(velocity[..., 0] * x + velocity[..., 1] * y) / xp.maximum(xp.sqrt(x * x + y * y), 1e-6),
        upright=sensors["upward"][..., 2],
    )


class TrunkReading(NamedTuple):
    """The motion of the middle section, as NumPy or JAX arrays with any leading axes. Its axes point forward, to its
    left and up.

    - `tilt` (..., 2): z components of the axes forward and to the left: the sines of pitch and roll, positive with the
      front and with the left side up.
    - `velocity` (..., 3): along its axes, m/s.
    - `rotation` (..., 3): rates of rotation about its axes, rad/s.
    """

    tilt: Any
    velocity: Any
    rotation: Any


def read_trunk(state: BodyState) -> TrunkReading:
    """Read how a hexapod's middle section moves (NumPy, JAX, tracers)."""
    sensors = state.sensors
    xp = state.position.__array_namespace__()
    forward = sensors["forward"]
    up = sensors["upward"]
    axes = xp.stack([forward, xp.cross(up, forward), up], axis=-2)

    def along_axes(vector: AnyArray) -> Any:
        return xp.sum(axes * vector[..., None, :], axis=-1)

    return TrunkReading(axes[..., :2, 2], along_axes(sensors["velocity"]), along_axes(sensors["rotation"]))


def add_hexapod_sensors(spec: mujoco.MjSpec) -> None:
    """Add all sensors to the skeleton of a hexapod."""
    for freedom in ("lateral", "vertical"):
        joints = [f"{freedom}_{leg}" for leg in LEGS]
        add_sensors(spec, "JOINTPOS", "JOINT", {joint: joint for joint in joints})
        add_sensors(spec, "JOINTVEL", "JOINT", {f"{joint}_velocity": joint for joint in joints})
    add_sensors(spec, "TOUCH", "SITE", {f"contact_{leg}": f"foot_{leg}" for leg in LEGS})
    add_sensors(spec, "TOUCH", "SITE", {f"belly_{section}": f"belly_{section}" for section in SECTIONS})
    for name, kind in (
        ("position", "FRAMEPOS"),
        ("forward", "FRAMEXAXIS"),
        ("velocity", "FRAMELINVEL"),
        ("rotation", "FRAMEANGVEL"),
        ("upward", "FRAMEZAXIS"),
    ):
        add_sensors(spec, kind, "SITE", {name: "trunk"})
