"""What a velocity servo is: a motor on a joint, for controllers that set velocities instead of firing muscles."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
from collections.abc import Iterable

import mujoco

from motorgrad.bodies._muscle import positive


@dataclasses.dataclass(frozen=True)
class Servo:
    r"""A motor that turns a joint at a desired velocity: $\tau = \mathrm{clip}(k_v (u - \dot q), \pm\tau_{max})$.

    **Arguments:** `name`, unique within the body; `group`: servos of one group get one number of the action, here the
    desired velocity $u$ in rad/s; `joint`: the name of the hinge; `gain`: $k_v$ in N m s/rad; `limit`: $\tau_{max}$ in
    N m.
    """

    name: str
    group: str
    joint: str
    gain: float
    limit: float

    def __post_init__(self) -> None:
        for field in ("gain", "limit"):
            positive(f"Servo {self.name!r} {field}", getattr(self, field))


def add_servos(spec: mujoco.MjSpec, servos: Iterable[Servo]) -> None:
    """Add servos to a skeleton that has their joints; they come after its muscles."""
    for servo in servos:
        actuator = spec.add_actuator(name=servo.name, target=servo.joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_velocity(kv=servo.gain)
        actuator.forcelimited = True
        actuator.forcerange = (-servo.limit, servo.limit)
