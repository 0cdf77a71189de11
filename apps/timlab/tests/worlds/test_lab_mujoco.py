"""Any MuJoCo model as a block, against MuJoCo's own loop."""

import mujoco
import numpy as np
import pytest

import timlab
from motorgrad import bodies
from timlab.blocks.worlds._mujoco import PENDULUM

CART = """
<mujoco>
  <option timestep="0.005"/>
  <worldbody>
    <body><joint name="x" type="slide" axis="1 0 0" damping="1"/><geom size="0.1"/><site name="tip" pos="0 0 1"/></body>
  </worldbody>
  <actuator><motor joint="x"/><motor name="second" joint="x" gear="-2"/></actuator>
  <sensor><framepos objtype="site" objname="tip"/><jointpos name="place" joint="x"/></sensor>
  <keyframe><key name="away" qpos="0.5"/></keyframe>
</mujoco>
"""


def driven(block, ticks, tick, watch, **levels):
    """A record of the model with constant controls."""
    diagram = timlab.Diagram(tick=tick)
    diagram.add("model", block)
    for name, level in levels.items():
        diagram.add(name, timlab.Constant(level))
        diagram.connect(name, f"model.{name}" if name in block.inputs else "model.actuator 1")
    return timlab.Run(diagram, 2, watch=[f"model.{port}" for port in watch]).advance(ticks)


def test_it_moves_as_mujoco_does():
    record = driven(
        timlab.MujocoModel(CART, keyframe="away"), 30, 0.02, ["place", "sensor 1", "qvel"], one=0.7, second=0.1
    )
    model = mujoco.MjModel.from_xml_string(CART)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = 0.7, 0.1
    for tick in range(30):
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(record["model.place"][:, tick], data.sensordata[3], rtol=1e-5)
        np.testing.assert_allclose(record["model.sensor 1"][1, tick], data.sensordata[:3], rtol=1e-5)
        np.testing.assert_allclose(record["model.qvel"][0, tick], data.qvel, rtol=1e-4, atol=1e-7)
        for _ in range(4):
            mujoco.mj_step(model, data)
    assert abs(record["model.place"][0, -1] - 0.5) > 0.01


def test_ports_are_the_actuators_and_sensors():
    block = timlab.MujocoModel(CART)
    assert list(block.inputs) == ["actuator 1", "second", "reset"]
    shapes = {name: port.shape for name, port in block.outputs.items()}
    assert shapes == {"sensor 1": (3,), "place": (), "qpos": (1,), "qvel": (1,), "diverged": ()}
    muscles = timlab.MujocoModel(bodies.to_mjcf(bodies.Hopper()))
    assert {"foot_height", "knee_angle"} <= set(muscles.outputs)
    assert len(muscles.inputs) > len(bodies.Hopper().groups)


def test_a_file_is_read_with_what_lies_beside_it(tmp_path):
    path = tmp_path / "cart.xml"
    path.write_text(CART)
    assert timlab.MujocoModel(file=str(path)).model.nu == 2
    path.write_text(CART.replace("<worldbody>", '<asset><mesh name="hull" file="hull.stl"/></asset><worldbody>'))
    with pytest.raises(ValueError, match=r"MuJoCo cannot compile it: .*hull\.stl") as raised:
        timlab.MujocoModel(file=str(path))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"xml": "<mujoco><worldbody>"}, "xml: not well-formed XML"),
        ({"xml": "<mujoco><worldbody><geom/></worldbody></mujoco>"}, "xml: MuJoCo cannot compile it.*size"),
        ({"xml": ""}, "xml = '': must be MJCF as text"),
        ({"xml": 3}, "xml = 3: must be a string"),
        ({"file": "nowhere.xml"}, r"file = '.*nowhere.xml'.*: must be an existing MJCF file"),
        (
            {"xml": CART.replace("<mujoco>", "<mujoco><size memory='50G'/>")},
            "xml: memory = 53687091200: must be such that the model takes at most 8 GiB",
        ),
        (
            {"xml": CART.replace("<geom", "<replicate count='1e9'><geom/></replicate><geom")},
            "<replicate> in line 5: count = '1e9'",
        ),
        ({"xml": CART, "keyframe": "awya"}, "did you mean 'away'"),
        ({"xml": PENDULUM.replace('name="torque"', 'name="reset"')}, "must be different from reset"),
    ],
)
def test_what_cannot_be_is_one_clear_line(given, told):
    with pytest.raises(ValueError, match=told) as raised:
        timlab.MujocoModel(**given)
    assert "\n" not in str(raised.value)


def test_it_is_put_back_where_it_breaks_and_where_it_is_asked():
    wild = PENDULUM.replace('gear="1"', 'gear="1e18"')
    record = driven(timlab.MujocoModel(wild), 4, 0.01, ["diverged", "angle"], torque=1e18)
    assert record["model.diverged"][0, 1:].all()
    assert not record["model.diverged"][0, 0]
    np.testing.assert_array_equal(record["model.angle"][0], 0.0)
    diagram = timlab.Diagram(tick=0.01)
    diagram.add("model", timlab.MujocoModel())
    diagram.add("push", timlab.Constant(0.3))
    diagram.add("reset", timlab.BLOCKS["expression"]("t > 0.045", ()))
    diagram.connect("push", "model.torque")
    diagram.connect("reset", "model.reset")
    angle = timlab.Run(diagram, 1, watch=["model.angle"]).advance(8)["model.angle"][0]
    assert (angle[1:6] != 0).all()
    np.testing.assert_array_equal(angle[6:], 0.0)


KINDS = [("compliant", "de-groote"), ("rigid", "de-groote"), ("compliant", "millard")]
QUICK = pytest.mark.representatives("compliant-de-groote")  # the bodies' own tests have all curves


@pytest.mark.ci
@pytest.mark.parametrize(("tendon", "curves"), KINDS)
def test_hill_muscles_move_as_in_the_library(tendon, curves):
    text = bodies.to_mjcf(bodies.Mjcf("arm6"))
    block = timlab.MujocoModel(text, keyframe="start", muscle_model="hill", tendon=tendon, curves=curves)
    record = driven(block, 12, 0.02, ["qpos"], **{"elbow flexor": 0.8})
    batch = bodies.BodyBatch(bodies.Mjcf(text, muscle_model="hill", tendon=tendon, curves=curves), 1)
    for tick in range(12):
        np.testing.assert_allclose(record["model.qpos"][1, tick], batch.packed[0, :2], rtol=1e-4, atol=1e-5)
        batch.step([[0, 0, 0.8, 0, 0, 0]])
    assert abs(batch.packed[0, 1] - 1.2) > 0.01


def test_the_muscle_law_is_the_bodies():
    rng = np.random.default_rng(1)
    activation, length, velocity = rng.uniform(0, 1, 5), rng.uniform(0.1, 0.3, 5), rng.normal(size=5)
    diagram = timlab.Diagram()
    diagram.add("muscle", timlab.MuscleLaw(900.0, 0.21, 0.4, 8.0, shape=(5,)))
    for name, value in (("activation", activation), ("length", length), ("velocity", velocity)):
        diagram.add(name, timlab.Constant(value, (5,)))
        diagram.connect(name, f"muscle.{name}")
    diagram.add("clock", timlab.UnitDelay())
    diagram.connect("clock", "clock")
    tension = timlab.Run(diagram, 1, watch=["muscle.tension"]).advance(1)["muscle.tension"][0, 0]
    np.testing.assert_allclose(tension, bodies.tension(activation, length, velocity, 900.0, 0.21, 0.4, 8.0), rtol=1e-5)


@pytest.mark.ci
@QUICK
@pytest.mark.parametrize(("tendon", "curves"), KINDS)
def test_the_hill_muscle_is_the_bodies(tendon, curves):
    lengths = (0.29, 0.3, 0.31)
    diagram = timlab.Diagram(tick=0.001)
    diagram.add("muscle", timlab.HillMuscle(pennation_angle=0.3, tendon=tendon, curves=curves, shape=(3,)))
    diagram.add("length", timlab.Constant(lengths, (3,)))
    diagram.add("excitation", timlab.Constant(0.8, (3,)))
    for name in ("length", "excitation"):
        diagram.connect(name, f"muscle.{name}")
    record = timlab.Run(diagram, 1, watch=["muscle.tension", "muscle.fiber", "muscle.activation"]).advance(60)
    # single precision finds the start of Millard's soft toe, where a slack muscle begins, to 1e-4 of the length
    force, fiber = (0.6, 2e-4) if curves == "millard" else (0.3, 1e-4)
    for place, length in enumerate(lengths):
        hill = bodies.Hill(1000.0, 0.1, 0.2, 0.3, tendon=tendon, curves=curves)
        run = bodies.contract(hill, length, 0.059, excitation=0.8)
        np.testing.assert_allclose(record["muscle.tension"][0, :, place], run.force, rtol=2e-3, atol=force)
        np.testing.assert_allclose(record["muscle.fiber"][0, :, place], run.fiber_length / 0.1, rtol=fiber)
        np.testing.assert_allclose(record["muscle.activation"][0, :, place], run.activation, atol=1e-5)


def test_a_tick_that_no_steps_make_up_is_refused_before_anything_runs():
    with pytest.raises(ValueError, match=r"tick of the block = 0\.003: must be a whole number of simulation steps"):
        driven(timlab.MujocoModel(), 1, 0.003, ["angle"])
    diagram = timlab.Diagram(tick=0.02)
    diagram.add("hopper", timlab.Body("hopper"))
    diagram.add("rest", timlab.Constant(0.0, (2,)))
    diagram.connect("rest", "hopper.action")
    told = r"hopper: tick of the block = 0\.02: must be a decision of the task, 0\.01 s"
    with pytest.raises(timlab.DiagramError, match=told):
        timlab.Run(diagram, 1)
    (problem,) = timlab.problems(diagram)
    assert str(problem).startswith("hopper: tick of the block")
