"""The classical experiments with one muscle: isometric contraction and quick release."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import math
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, check_not_negative, check_positive
from motorgrad.bodies._body import add_muscles, compile_model
from motorgrad.bodies.muscles._hill import Hill, HillMuscle, read_hill
from motorgrad.bodies.muscles._muscle import Attachment


class Contraction(NamedTuple):
    """A muscle over time: arrays `(times,)` of the time in s, the activation, the lengths of the path, of the fiber and
    of the tendon in m, and the force in N."""

    seconds: Float[np.ndarray, " times"]
    activation: Float[np.ndarray, " times"]
    length: Float[np.ndarray, " times"]
    fiber_length: Float[np.ndarray, " times"]
    tendon_length: Float[np.ndarray, " times"]
    force: Float[np.ndarray, " times"]


def contract(
    hill: Hill,
    length: float,
    seconds: float,
    excitation: float = 1.0,
    activation: float = 0.0,
    release: float = math.inf,
    load: float = 0.0,
    mass: float = 1.0,
    timestep: float = 0.001,
) -> Contraction:
    """Simulate one Hill-type muscle in MuJoCo: held at a length, and then released to a load.

    **Arguments:**

    - `hill`: the muscle.
    - `length` (m): length of its path while it is held.
    - `seconds` (s): how long.
    - `excitation`: from 0 to 1, from the start.
    - `activation`: at the start, where the muscle is in balance with its tendon.
    - `release` (s): when it is let go; never by default, so that the contraction is isometric.
    - `load` (N): the force that stretches it thereafter.
    - `mass` (kg): mass of what it moves.
    - `timestep` (s): time step of the physics.

    ```python
    soleus = mg.bodies.Hill(3500.0, optimal_fiber_length=0.05, tendon_slack_length=0.25)
    run = mg.bodies.contract(soleus, length=0.3, seconds=0.3)
    print(run.force[-1] > 0.9 * 3500)  # → True
    ```
    """
    for name, value in (("length", length), ("seconds", seconds), ("mass", mass), ("timestep", timestep)):
        check_positive(name, value)
    for name, value in (("excitation", excitation), ("activation", activation)):
        check(0.0 <= value <= 1.0, name, value, "from 0 to 1")
    check_not_negative("load", load)
    model = compile_model(_bench(hill, mass, timestep))
    data = mujoco.MjData(model)
    data.qpos[0], data.ctrl[0], data.act[-1] = length, excitation, activation
    rows = []
    for step in range(round(seconds / timestep) + 1):
        mujoco.mj_forward(model, data)
        state = read_hill(model, data, 0)
        rows.append((data.act[-1], data.qpos[0], state.fiber_length, state.tendon_length, -data.actuator_force[0]))
        held = (step + 0.5) * timestep < release
        data.qfrc_applied[0] = 0.0 if held else load
        mujoco.mj_step(model, data)
        if held:
            data.qpos[0] = length
            data.qvel[0] = 0.0
    return Contraction(timestep * np.arange(len(rows)), *np.array(rows).T)


def _bench(hill: Hill, mass: float, timestep: float) -> mujoco.MjSpec:
    """A muscle along x from the world to a ball on a slide, whose position is the length of the path."""
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity = (0.0, 0.0, 0.0)
    ball = spec.worldbody.add_body(name="ball")
    ball.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1, 0, 0))
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.02, 0, 0), mass=mass)
    ends = Attachment("world", (0.0, 0.0, 0.0)), Attachment("ball", (0.0, 0.0, 0.0))
    add_muscles(spec, [HillMuscle("muscle", "muscle", *ends, hill)])
    return spec
