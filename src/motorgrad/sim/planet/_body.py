"""A body on a planet: its model, many steps of it, and tasks with it."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses

import mujoco
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import WrappedBody, compile_model
from motorgrad.sim.planet._patch import FIELD
from motorgrad.sim.planet._planet import Planet

PLANET = "planet"
"""The name of the body, without a shape, whose pose is that of the planet in local coordinates."""

_LIGHT = 1e-6  # kg; what it weighs must not count in the centre of mass


@dataclasses.dataclass(frozen=True)
class OnPlanet(WrappedBody):
    """A body on a planet: a body like any other, whose floor is the patch of ground around it.

    Its posture says where it is on the planet too, since the planet is a part of the model, last in `qpos`. Simulate it
    with `PlanetBatch`, which lays the patch; under anything else it falls off its edge.

    **Arguments:** `body`, whose every part that hangs on the world has a free joint, and the `planet` under it.

    **Raises:** `ValueError` for a body that is held by the world, or has no geom "floor".
    """

    planet: Planet = dataclasses.field(default_factory=Planet)

    def spec(self) -> mujoco.MjSpec:
        """A fresh, editable `mujoco.MjSpec` of the body, its patch of ground, and the planet."""
        spec = self.body.spec()
        free = mujoco.mjtJoint.mjJNT_FREE
        held = [part.name for part in spec.worldbody.bodies if [joint.type for joint in part.joints] != [free]]
        check(not held, "parts of the body that the world holds", held, "none, each with a free joint, on a planet")
        floor = spec.geom("floor")
        check(floor is not None, "geoms of the body", [geom.name for geom in spec.geoms], "such that one is 'floor'")
        check(not spec.hfields, "height fields of the body", len(spec.hfields), "none: the planet has its own terrain")
        plain = compile_model(self.body)
        self.planet.ground.add(spec, floor)
        spec.delete(floor)
        planet = spec.worldbody.add_body(name=PLANET, mass=_LIGHT, inertia=(_LIGHT,) * 3, gravcomp=1.0)
        planet.explicitinertial = True
        planet.add_freejoint(name=PLANET)
        pose, lift = self.planet.start.pose, self.planet.lift
        planet.pos, planet.quat = pose[:3], pose[3:]
        parts = plain.jnt_qposadr[plain.jnt_type == free]
        for key in spec.keys:
            position = np.array(key.qpos)
            position[parts + 2] += lift
            key.qpos = np.concatenate([position, pose])
            if len(key.qvel):
                key.qvel = np.concatenate([key.qvel, np.zeros(6)])
        # of the body alone, by which viewers size what they show
        for name in ("meanmass", "meansize", "extent", "center"):
            setattr(spec.stat, name, getattr(plain.stat, name))
        return spec


def check_names(model: mujoco.MjModel) -> bool:
    """Whether a model is of a body on a planet."""
    named = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) >= 0 for name in (PLANET, FIELD)]
    return all(named)
