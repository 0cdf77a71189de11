"""The hopper: four links in a rhombus under a load on a slide, with a foot, two flexors and two extensors."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType

import mujoco
import numpy as np

from motorgrad.bodies._body import START, add_muscles
from motorgrad.bodies._hopper_numbers import HopperNumbers
from motorgrad.bodies._hopper_parts import SIDES, skeleton
from motorgrad.bodies._muscle import Attachment, Muscle, Wrap, groups_of


@dataclasses.dataclass(frozen=True)
class Hopper(HopperNumbers):
    """A planar hopper whose one controllable freedom is the angle of its knees (thesis, section 5.2).

    The load hangs on a vertical slide (the harness). From it two thighs lead to the knees and two shanks back together
    to the foot. Each knee has a flexor in front (inside the rhombus) and an extensor behind; the two flexors are one
    group and the two extensors the other, so an action is two numbers. x points to the right, z up, the plane is y = 0.

    **Arguments:**

    - `load_mass` (kg): of the load on the slide.
    - `link_length` (m): of each of the four links.
    - `link_mass` (kg): of each of the four links.
    - `foot_mass` (kg): of the foot.
    - `foot_size` (m): half-lengths (x, y, z) of the foot's box.
    - `knee_range` (degrees): least and greatest interior angle of a knee, with 0 < least < 90 < greatest < 180; the
      stop is stiff but not rigid.
    - `armature` (kg m²): of every hinge.
    - `joint_damping` (N m s/rad): of every hinge; the slide is free.
    - `capsule_radius` (m): ρ of the sphere around each knee.
    - `attachment_distance` (m): from the knee to a muscle's ends, on the bone.
    - `flexor_strength` (N): greatest contractile force of a flexor.
    - `flexor_rest_length` (m): length at which it is greatest.
    - `extensor_strength` (N): greatest contractile force of an extensor.
    - `extensor_rest_length` (m): length at which it is greatest.
    - `muscle_damping` (N s/m): k_SE of every muscle.
    - `muscle_shape`: k_CE of every muscle; the larger, the flatter the force–length curve.
    - `lateral`: "symmetric" holds the foot under the load; "spring" lets the body lean, against a spring.
    - `lateral_stiffness` (N m/rad): of that spring.
    - `lateral_damping` (N m s/rad): of that spring.
    - `timestep` (s): of the physics.
    - `muscle_model`: "thesis" (exact law, needs the callback) or "native" (MuJoCo's own muscle, an approximation).
    - `extra_muscles`: further muscles; a new group name makes a new component of the action.

    **Names in the model:** bodies `load`, `thigh_left`, `shank_left`, `foot`, `thigh_right`, `shank_right`, each
    link's frame at its upper joint with −z along the bone; joints `height`, `hip_left`, `knee_left`, `ankle`,
    `hip_right`, `knee_right`; at each knee a sphere `capsule_left` and the sites `front_left` and `behind_left`.

    **Sensors:** `knee_angle` (rad from 90°, positive when extended), `knee_velocity` (rad/s), `foot_height` (the
    underside above the floor, m), `foot_contact` (normal force on the foot, N), `load_height` (m).

    **Raises:** `ValueError` naming the field and what it may be.
    """

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """Flexor and extensor of the left knee, then of the right, then the extra ones."""
        own = (self._muscle(group, side) for side in SIDES for group in ("flexor", "extensor"))
        return (*own, *self.extra_muscles)

    @property
    def groups(self) -> tuple[str, ...]:
        """("flexor", "extensor") and the groups of extra muscles."""
        return groups_of(self.muscles)

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """Heights are the z of a position sensor."""
        return MappingProxyType({"foot_height": 2, "load_height": 2})

    def spec(self) -> mujoco.MjSpec:
        """A fresh, editable `mujoco.MjSpec` of the hopper, standing on the floor with its knees at 90°."""
        spec = skeleton(self)
        add_muscles(spec, self.muscles, self.muscle_model)
        spec.add_key(name=START, qpos=np.zeros(6))
        return spec

    def _muscle(self, group: str, side: str) -> Muscle:
        flexor = group == "flexor"
        return Muscle(
            name=f"{group}_{side}",
            group=group,
            origin=Attachment(f"thigh_{side}", (0.0, 0.0, self.attachment_distance - self.link_length)),
            insertion=Attachment(f"shank_{side}", (0.0, 0.0, -self.attachment_distance)),
            strength=self.flexor_strength if flexor else self.extensor_strength,
            rest_length=self.flexor_rest_length if flexor else self.extensor_rest_length,
            damping=self.muscle_damping,
            shape=self.muscle_shape,
            wrap=Wrap(f"capsule_{side}", f"{'front' if flexor else 'behind'}_{side}"),
        )
