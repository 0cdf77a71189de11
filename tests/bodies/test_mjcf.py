"""Any MuJoCo model as a body: read once, stepped like every body, its parts found by name."""

import dataclasses
import pickle
import struct

import mujoco
import numpy as np
import pytest

from motorgrad.bodies import Anatomy, BodyBatch, Mjcf, compile_model, to_mjcf
from motorgrad.bodies.mjcf._mjcf import BUNDLED
from motorgrad.schema import build, table

ZOO = """
<mujoco>
  <option timestep="0.004"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="ball" pos="0 0 .3"><freejoint name="ball"/><geom name="ball" size=".1"/></body>
    <body name="crane" pos="1 0 1">
      <joint name="turn" axis="0 0 1" range="-1 1" limited="true"/>
      <geom type="capsule" fromto="0 0 0 .5 0 0" size=".03"/>
      <site name="tip" pos=".5 0 0"/>
      <body pos=".5 0 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/></body>
      <body pos="0 0 .2"><joint name="slide" type="slide" axis="1 0 0"/><geom size=".05"/></body>
    </body>
  </worldbody>
  <tendon><fixed name="both"><joint joint="turn" coef="1"/><joint joint="slide" coef=".5"/></fixed></tendon>
  <equality><joint joint1="slide" joint2="turn" polycoef="0 .1 0 0 0"/></equality>
  <actuator>
    <motor joint="turn"/>
    <position name="hold" joint="turn" kp="20" ctrllimited="true" ctrlrange="-.5 .5"/>
    <general name="lag" joint="slide" dyntype="filterexact" dynprm=".05" gainprm="3"/>
    <muscle name="pull" tendon="both" lengthrange="-1 1" force="5"/>
    <velocity name="spin" joint="slide" kv="2"/>
  </actuator>
  <sensor><jointpos joint="turn"/><framepos name="where" objtype="site" objname="tip"/></sensor>
  <keyframe>
    <key name="rest"/>
    <key name="turned" qpos="0 0 .3 1 0 0 0 .4 0 .04"/>
  </keyframe>
</mujoco>
"""


@pytest.fixture
def zoo():
    return Mjcf(ZOO)


def test_every_actuator_is_stepped_as_mujoco_steps_it(zoo):
    assert zoo.groups == ("actuator 1", "hold", "lag", "pull", "spin")
    batch = BodyBatch(dataclasses.replace(zoo, start="turned"), 3, substeps=2)
    control = np.random.default_rng(0).uniform(-1, 1, (20, 3, 5))
    model = mujoco.MjModel.from_xml_string(ZOO)
    bodies = [mujoco.MjData(model) for _ in range(3)]
    for data in bodies:
        mujoco.mj_resetDataKeyframe(model, data, 1)
    for action in control:
        batch.step(action)
        for data, each in zip(bodies, action, strict=True):
            data.ctrl[:] = each
            mujoco.mj_step(model, data, 2)
    state = batch.unpack(batch.packed)
    for row, data in enumerate(bodies):
        mujoco.mj_forward(model, data)
        np.testing.assert_array_equal(state.position[row], data.qpos.astype(np.float32))
        np.testing.assert_array_equal(state.velocity[row], data.qvel.astype(np.float32))
        np.testing.assert_array_equal(state.activation[row], data.act.astype(np.float32))
        np.testing.assert_array_equal(state.sensors["where"][row], data.sensor("where").data.astype(np.float32))
    assert np.ptp(state.activation) > 0
    assert "sensor 1" in state.sensors


def test_it_starts_in_its_first_keyframe_or_in_the_one_named(zoo):
    at = {start: BodyBatch(dataclasses.replace(zoo, start=start), 1).packed[0, 7] for start in (None, "rest", "turned")}
    assert at == pytest.approx({None: 0.0, "rest": 0.0, "turned": 0.4})
    bare = Mjcf("<mujoco><worldbody><body><joint type='slide' ref='1'/><geom size='.1'/></body></worldbody></mujoco>")
    batch = BodyBatch(bare, 1)
    assert batch.packed[0, 0] == 1.0
    batch.step(np.zeros((1, 0)))
    with pytest.raises(ValueError, match="unknown keyframe 'turn': did you mean 'turned'"):
        dataclasses.replace(zoo, start="turn")


def test_a_task_may_choose_where_rows_begin(zoo):
    batch, twin = BodyBatch(zoo, 4), BodyBatch(zoo, 4)
    rng = np.random.default_rng(1)
    position = np.tile(zoo.model.qpos0, (2, 1))
    position[:, 7] = rng.uniform(-1, 1, 2)
    velocity = rng.normal(size=(2, zoo.model.nv))
    before = batch.packed.copy()
    batch.reset(np.array([3, 1]), position, velocity)
    state = batch.unpack(batch.packed)
    np.testing.assert_array_equal(state.position[[3, 1]], position.astype(np.float32))
    np.testing.assert_array_equal(state.velocity[[3, 1]], velocity.astype(np.float32))
    np.testing.assert_array_equal(batch.packed[[0, 2]], before[[0, 2]])
    data = mujoco.MjData(zoo.model)
    data.qpos[:] = position[0]
    mujoco.mj_forward(zoo.model, data)
    np.testing.assert_allclose(state.sensors["where"][3], data.sensor("where").data, rtol=1e-6)
    twin.restore(batch.snapshot())
    for each in (batch, twin):
        each.step(np.ones((4, 5)))
    np.testing.assert_array_equal(batch.packed, twin.packed)
    with pytest.raises(ValueError, match=r"qpos.shape = \(1, 10\): must be \(rows, qpos\) = \(2, 10\)"):
        batch.reset([0, 1], position[:1])


def test_parts_are_found_by_name_and_the_nearest_is_named(zoo):
    anatomy = Anatomy(zoo)
    assert anatomy.positions(["turn", "slide"])[1].tolist() == [7, 9]
    assert anatomy.velocities("joint*")[0] == ["joint 3"]
    assert anatomy.positions("ball")[0] == [f"ball {i}" for i in range(1, 8)]
    assert anatomy.velocities("ball")[1].tolist() == list(range(6))
    assert anatomy.activations()[0] == ["lag", "pull"]
    assert anatomy.groups(["spin", "hold"]).tolist() == [4, 1]
    np.testing.assert_array_equal(anatomy.control_range, [(-1, 1), (-0.5, 0.5), (-1, 1), (0, 1), (-1, 1)])
    assert anatomy.place("tip") == ("SITE", "tip")
    for look, told in (
        (lambda: anatomy.positions("turns"), "unknown joint 'turns': did you mean 'turn'"),
        (lambda: anatomy.activations("hold"), "unknown actuator with an activation 'hold'"),
        (lambda: anatomy.place("tap"), "unknown site, body or geom 'tap': did you mean 'tip'"),
        (lambda: anatomy.groups("pul"), "did you mean 'pull'"),
    ):
        with pytest.raises(ValueError, match=told):
            look()


def test_sensors_that_are_asked_for_are_added(zoo):
    anatomy = Anatomy(zoo)
    names = [anatomy.sensor("ACTUATORPOS", "ACTUATOR", "pull"), anatomy.sensor("FRAMEPOS", *anatomy.place("crane"))]
    state = BodyBatch(anatomy.sensed, 2).unpack(BodyBatch(anatomy.sensed, 2).packed)
    assert state.sensors[names[0]].shape == (2,)
    np.testing.assert_array_equal(state.sensors[names[1]][0], [1, 0, 1])
    again = Anatomy(zoo)
    again.sensors |= anatomy.sensors
    assert again.sensed == anatomy.sensed


def test_it_is_a_setting_like_any_other(tmp_path, zoo):
    file = tmp_path / "zoo.xml"
    file.write_text(ZOO)
    for body in (zoo, Mjcf(file), Mjcf(), Mjcf(str(file), start="turned", timestep=0.002)):
        again = build(Mjcf, table(body))
        assert again == body
        assert hash(again) == hash(body)
        assert pickle.loads(pickle.dumps(body)) == body
    assert Mjcf(file).timestep == 0.004
    assert compile_model(Mjcf(file, timestep=0.002)).opt.timestep == 0.002
    assert Mjcf(file).source.is_absolute()


def test_a_file_that_has_changed_is_refused(tmp_path):
    part = tmp_path / "part.xml"
    part.write_text('<mujoco><worldbody><body><joint/><geom name="g" size=".1"/></body></worldbody></mujoco>')
    whole = tmp_path / "whole.xml"
    whole.write_text('<mujoco><include file="part.xml"/></mujoco>')
    body = Mjcf(whole)
    assert build(Mjcf, table(body)) == body
    part.write_text(part.read_text().replace(".1", ".2"))
    with pytest.raises(ValueError, match=r"whole.xml'.*checksum.*not what it was"):
        build(Mjcf, table(body))
    assert Mjcf(whole) != body


def test_a_description_is_kept_whole(tmp_path, zoo):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    faces = [
        struct.pack("<12fH", 0, 0, 0, *corners[list(f)].ravel(), 0)
        for f in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    ]
    mesh = tmp_path / "meshes" / "m.stl"
    mesh.parent.mkdir()
    mesh.write_bytes(bytes(80) + struct.pack("<I", 4) + b"".join(faces))
    text = ZOO.replace("<worldbody>", '<asset><mesh name="m" file="m.stl"/></asset><worldbody>', 1)
    text = text.replace("<mujoco>", '<mujoco><compiler meshdir="meshes"/>').replace(
        'size=".05"', 'type="mesh" mesh="m"'
    )
    file = tmp_path / "zoo.xml"
    file.write_text(text)
    spec = mujoco.MjSpec.from_file(str(file))
    spec.option.gravity = (0, 0, -1.62)
    body = Mjcf(spec)
    mesh.unlink()
    file.unlink()
    again = build(Mjcf, table(body))
    assert again == body
    assert compile_model(again).nmesh == 1
    assert compile_model(again).opt.gravity[2] == -1.62
    assert Mjcf(zoo.spec()).groups == zoo.groups
    assert compile_model(Mjcf(to_mjcf(zoo))).nu == 5


def test_what_mujoco_refuses_is_one_clear_line(tmp_path):
    for source, told in (
        ("<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>", r"^xml: MuJoCo cannot compile it: [^\n]*$"),
        ("<mujoco>", r"^xml: not well-formed XML: [^\n]*$"),
        (tmp_path / "none.xml", r"^file = '.*none.xml'.*: must be an existing MJCF file$"),
        ("arm", r"^unknown model 'arm': did you mean 'arm6'"),
        ("<mujoco><size nkey='2000000000'/></mujoco>", "at most 1 GiB"),
    ):
        with pytest.raises(ValueError, match=told):
            Mjcf(source)
    with pytest.raises(ValueError, match=r"timestep = -1.0: must be a finite number above 0, in s"):
        Mjcf(ZOO, timestep=-1)


@pytest.mark.parametrize("name", BUNDLED)
def test_models_of_the_library(name):
    model = Mjcf(name).model
    assert model.nu > 0
    assert model.nkey > 0
