"""Joints: moment arms against the lengths of the muscles, and numbers with units."""

import mujoco
import numpy as np
import pytest

from motorgrad.bodies import Arm, Hopper, compile_model
from timsim.panels._joints import draw_arms, joint_table, joints_of, moment_arms


@pytest.mark.parametrize("body", [Hopper(), Arm()], ids=["hopper", "arm"])
def test_a_moment_arm_is_the_change_of_length_with_the_angle(body):
    """Away from where a path begins to wrap, by central differences of the engine's own lengths."""
    model = compile_model(body)
    data, checked = mujoco.MjData(model), 0
    start = np.array(model.key_qpos[0])
    for joint in joints_of(model).values():
        places, arms = moment_arms(model, start, joint)
        for place, row in zip(places[5:-5:10], arms[5:-5:10], strict=True):
            lengths = []
            for step in (-1e-6, 1e-6):
                data.qpos[:] = start
                data.qpos[joint.place] = place + step
                mujoco.mj_fwdPosition(model, data)
                lengths.append(np.array(data.actuator_length))
            np.testing.assert_allclose(row, -(lengths[1] - lengths[0]) / 2e-6, atol=2e-5)  # m
            checked += np.count_nonzero(np.abs(row) > 1e-3)
    assert checked >= 4


def test_a_joint_is_told_with_its_units():
    model = compile_model(Hopper())
    data = mujoco.MjData(model)
    joints = joints_of(model)
    data.qpos[joints["knee_left"].place] = np.radians(30)
    data.qvel[joints["knee_left"].freedom] = np.radians(-90)
    mujoco.mj_forward(model, data)
    facts = dict(joint_table(model, data, joints["knee_left"]))
    assert (facts["angle"], facts["limits"], facts["speed"]) == ("30.0°", "−50.0° to 60.0°", "−90.0°/s")
    assert facts["by actuators"].endswith(" N·m")
    slide = dict(joint_table(model, data, joints["height"]))
    assert (slide["limits"], slide["position"][-3:], slide["by actuators"]) == ("none", " mm", "0 N")


def test_the_longest_arms_are_drawn_and_named():
    model = compile_model(Hopper())
    joint = joints_of(model)["knee_left"]
    arms = {f"muscle {number}": np.full(41, 0.001 * number) for number in range(1, 9)}
    picture = draw_arms(joint, np.linspace(-1, 1, 41), arms, 0.2)
    assert [name for name in arms if f"— {name}<" in picture] == [f"muscle {number}" for number in range(3, 9)]
    assert "moment arm (mm)" in picture
    assert "angle (°)" in picture
