"""Which poses muscles can hold: closed forms of a pendulum, and a simulation of what is said to be stable."""

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.tasks import HoldingWarning, held_poses, spread_poses

PENDULUM = """
<mujoco><compiler angle="radian"/><worldbody><body>
  <joint name="hinge" axis="0 -1 0" range="-1.5 1.5" damping="0.5"/>
  <geom type="capsule" fromto="0 0 0 0 0 -1" size=".02" mass="1"/><site name="tip" pos="0 0 -1"/>
</body></worldbody><actuator>{muscles}</actuator></mujoco>
"""
FLEXOR = '<muscle name="flexor" joint="hinge" gear="1" force="{force}" lengthrange="-1.6 1.6"/>'
EXTENSOR = '<muscle name="extensor" joint="hinge" gear="-1" force="{force}" lengthrange="-1.6 1.6"/>'


def pendulum(*muscles, force=100):
    return PENDULUM.format(muscles="".join(muscles).format(force=force))


def held(text, poses):
    return held_poses(mujoco.MjModel.from_xml_string(text), poses)


POSES = np.linspace(-1.4, 1.4, 29)[:, None]


def test_one_muscle_balances_the_half_in_which_gravity_pulls_against_it():
    found = held(pendulum(FLEXOR, force=30), POSES)
    # a muscle pulls towards a shorter path, which is the joint's angle: it leans the pendulum to negative angles only
    np.testing.assert_array_equal(found.balanced, (POSES[:, 0] < 0.01))


def test_two_strong_muscles_balance_all_and_weak_ones_what_their_force_allows():
    assert held(pendulum(FLEXOR, EXTENSOR), POSES).balanced.all()
    assert not held(pendulum(FLEXOR, EXTENSOR, force=0.01), POSES).balanced[np.abs(POSES[:, 0]) > 0.1].any()


def test_a_body_without_muscles_or_with_a_free_base_is_not_looked_at():
    assert held('<mujoco><worldbody><body><joint/><geom size=".1"/></body></worldbody></mujoco>', None) is None
    assert held_poses(mg.make("hopper").dynamics.spec().compile()) is None


def test_poses_are_spread_evenly_over_the_ranges_and_are_always_the_same():
    model = mg.bodies.Mjcf("arm6").model
    poses = spread_poses(model, 256)
    np.testing.assert_array_equal(poses, spread_poses(model, 256))
    low, high = model.jnt_range.T
    shares = (poses - low) / (high - low)
    counts = np.histogram2d(*shares.T, bins=4, range=[[0, 1], [0, 1]])[0]
    assert abs(counts - 16).max() <= 4


def test_the_library_s_arm_holds_all_its_poses():
    found = held_poses(mg.bodies.Mjcf("arm6").model)
    assert found.balanced.all()
    assert found.stable.all()


def test_the_user_is_told_once_when_a_task_is_composed():
    terms = {"observe": ["joint-positions"], "reward": ["effort"], "time_limit": 1.0}
    text = pendulum(FLEXOR, force=0.02)
    with pytest.warns(
        HoldingWarning, match=r"\d+% of the poses can be held by any constant activation.*a sample of 32"
    ):
        mg.tasks.compose(text, **terms)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mg.tasks.compose(text, **terms)


def test_an_arm_whose_muscles_can_hold_a_third_of_its_poses_is_told(tmp_path):
    # linear programs alone, of MuJoCo's own torques, say 0.9375 and 0.2975 of 400 poses
    file = Path(__file__).with_name("arm_six_muscles_gravity.xml")
    found = held_poses(mujoco.MjModel.from_xml_path(str(file)), spread_poses(mg.bodies.Mjcf(file).model, 400))
    assert found.balanced.mean() == pytest.approx(0.9375, abs=0.005)
    assert found.stable.mean() == pytest.approx(0.2975, abs=0.005)
    with pytest.warns(HoldingWarning, match="34% of the poses can be held by any constant activation, 94% by one that"):
        mg.tasks.compose(file, observe=["joint-positions"], reward=["effort"], time_limit=1.0)
