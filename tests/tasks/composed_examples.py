"""A body with something of everything, and a task on it."""

import mujoco
import numpy as np

from motorgrad.bodies import Mjcf
from motorgrad.tasks import compose, terms

MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="ball" pos="0 .5 .09"><freejoint name="ball"/><geom name="ball" size=".1"/></body>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" range="-1 1" limited="true" damping=".1"/>
      <geom name="upper" type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
      <site name="mid" pos=".15 0 0"/>
      <body name="lower" pos=".3 0 0">
        <joint name="elbow" axis="0 1 0" range="0 2" limited="true" damping=".1"/>
        <geom name="lower" type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
        <site name="hand" pos=".3 0 0"/>
      </body>
    </body>
    <site name="anchor" pos="0 0 1.2"/>
  </worldbody>
  <tendon><spatial name="line" damping="1"><site site="anchor"/><site site="mid"/></spatial></tendon>
  <actuator>
    <muscle name="lift" tendon="line" ctrllimited="true" ctrlrange="0 1" force="300"/>
    <motor name="bend" joint="elbow" gear="2"/>
    <position name="hold" joint="elbow" kp="3" ctrllimited="true" ctrlrange="0 2"/>
  </actuator>
  <sensor><gyro name="gyro" site="hand"/><clock name="clock"/></sensor>
  <keyframe>
    <key name="low" qpos="0 .5 .09 1 0 0 0 .3 .2"/>
    <key name="high" qpos="0 .5 .09 1 0 0 0 -.3 .9"/>
  </keyframe>
</mujoco>
"""
BODY = Mjcf(MODEL)
OBSERVE = (
    terms.JointPositions(("shoulder", "elbow")),
    terms.JointVelocities(("shoulder", "elbow"), scale=0.1),
    terms.MuscleLengths(),
    terms.MuscleVelocities("lift"),
    terms.MuscleForces(),
    terms.Activations(),
    terms.Positions(("hand", "ball")),
    terms.Velocities("hand"),
    terms.SensorReadings("gyro"),
    terms.Contacts(("ball",)),
    terms.PreviousAction(),
    terms.Clock(),
    terms.Height("ball"),
)
"""What does not need a target; the ball lies on the floor."""


def task(**changes):
    """A task on that body."""
    settings = {"observe": OBSERVE, "reward": ["alive"], "scaling": "none"} | changes
    return compose(settings.pop("body", BODY), **settings)


def moved(control, steps, key=0):
    """MuJoCo's own data after physics steps under controls, `(decisions, actuators)`."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    for each in control:
        data.ctrl[:] = each
        mujoco.mj_step(model, data, steps)
    before = data.qacc.copy()
    contact = np.zeros(6)
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, contact)
    force = data.actuator_force.copy()
    mujoco.mj_forward(model, data)
    return model, data, force, float(np.linalg.norm(contact[:3])), before
