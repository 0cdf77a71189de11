"""Editing masses, sizes, friction and the world: what MuJoCo makes of it, and the way back."""

import mujoco
import numpy as np
import pytest

from motorgrad.bodies import Arm, Hexapod, Hopper, Terrain, compile_model
from timsim import live
from timsim.live._numbers import ANY, editable_numbers, owned, write_numbers
from timsim.panels._settings_form import words_of

PENDULUM = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="rod" pos="0 0 .5">
      <joint name="swing" axis="0 1 0"/>
      <inertial pos="0 0 -.2" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom name="arm" type="capsule" size=".02 .2" pos="0 0 -.2"/>
      <geom name="bob" type="sphere" size="{radius}" pos="0 0 -.4"/>
    </body>
  </worldbody>
</mujoco>
"""
BOUNDS = {"bvh_aabb"}  # wider than they must be, where a geom has grown


def pendulum(mass=1.0, inertia=0.01, radius=0.05):
    return mujoco.MjModel.from_xml_string(PENDULUM.format(mass=mass, inertia=inertia, radius=radius))


def arrays(model):
    """All arrays of a model, and gravity and the time step, copied."""
    names = [name for name in dir(model) if isinstance(getattr(model, name), np.ndarray)]
    found = {name: np.array(getattr(model, name)) for name in names}
    return found | {"gravity": np.array(model.opt.gravity), "timestep": np.array(model.opt.timestep)}


def differing(one, other):
    return {name for name in one if not np.array_equal(one[name], other[name])}


def test_an_edited_model_is_the_one_that_mujoco_compiles_with_these_numbers():
    model, numbers = pendulum(), editable_numbers(pendulum())
    values = {name: number.get(model) for name, number in numbers.items()}
    assert (values["body.rod.mass"], values["body.rod.radius[bob]"]) == (1.0, 0.05)
    write_numbers(model, numbers, values | {"body.rod.mass": 3.0, "body.rod.radius[bob]": 0.08})
    wanted = arrays(pendulum(3.0, 0.03, 0.08))
    found = arrays(model)
    apart = {name for name in wanted if not np.allclose(found[name], wanted[name], rtol=1e-12, atol=1e-15)}
    assert apart <= BOUNDS
    assert np.all(found["bvh_aabb"][:, 3:] >= wanted["bvh_aabb"][:, 3:] - 1e-12)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    write_numbers(model, numbers, values | {"body.rod.radius[bob]": 0.11})  # it reaches the floor, 0.1 m below
    mujoco.mj_forward(model, data)
    assert data.ncon == 1
    assert data.contact[0].dist == pytest.approx(-0.01)


def test_names_with_dots_and_brackets_belong_to_their_parts():
    text = PENDULUM.format(mass=1.0, inertia=0.01, radius=0.05)
    text = text.replace('name="rod"', 'name="rod[0].a"').replace('name="bob"', 'name="bob]["')
    names = editable_numbers(mujoco.MjModel.from_xml_string(text))
    sizes = ["radius[arm]", "half_length[arm]", "radius[2]"]
    assert owned(names, "rod[0].a") == [f"body.rod[0].a.{field}" for field in ("mass", "friction", *sizes)]
    assert owned(names, "rod[0]") == owned(names, "rod") == []
    found = [words_of(name)[0] for name in owned(names, "rod[0].a")]
    assert found == ["mass (kg)", "friction", "arm: radius (m)", "arm: half length (m)", "2: radius (m)"]


@pytest.mark.parametrize("body", [Hopper(), Hexapod(), Arm()], ids=["hopper", "hexapod", "arm"])
def test_every_number_can_be_changed_and_comes_back_to_the_last_bit(body):
    spec = body.spec()
    live.Stage(terrain=Terrain(height=0.02) if isinstance(body, Hexapod) else None).put_into(spec)
    model = compile_model(spec)
    numbers = editable_numbers(model)
    fresh, values = arrays(model), {name: number.get(model) for name, number in numbers.items()}
    assert "body.world.gravity_z" in owned(numbers, "world")
    for name, number in numbers.items():
        other = values[name] * 1.5 + (number.allowed == ANY) + (values[name] == 0)
        assert write_numbers(model, numbers, values | {name: other})
        assert {each for each in numbers if numbers[each].get(model) != values[each]} == {name}
        assert not write_numbers(model, numbers, values | {name: other})
        write_numbers(model, numbers, values)
    assert differing(arrays(model), fresh) == set()


def test_parts_and_world_are_edited_in_a_run_and_time_travel_repeats_it(hopper):
    edits = {
        "body.load.mass": 4.0,
        "body.foot.friction": 0.3,
        "body.world.gravity_z": -1.62,
        "body.world.timestep": 0.0005,
    }
    hopper(live.Reset(), live.Step(30))
    before = dict(hopper.worker.subject.settings)
    said = hopper(*(live.Edit(name, value) for name, value in edits.items()), live.Step(40))
    assert [kind for kind, _ in said] == ["change"] * len(edits)
    batch = hopper.worker.subject._stepper.batch
    assert batch.substeps * batch.model.opt.timestep == pytest.approx(hopper.worker.subject.period)
    assert batch.model.body("load").mass == 4.0
    end = hopper.seen()
    hopper(live.Scrub(10))
    assert hopper.worker.subject.settings == before
    assert batch.model.body("load").mass == before["body.load.mass"]
    hopper(live.Scrub(70))
    assert np.array_equal(hopper.seen()["position"], end["position"])
    assert hopper.worker.subject.settings == before | edits
    hopper(*[live.Undo() for _ in edits])
    assert hopper.seen()["decision"] == 30
    assert hopper.worker.subject.settings == before
    assert hopper.worker.subject._stepper.batch.substeps == 10


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("body.load.mass", 0.0, "body.load.mass = 0.0: must be above 0"),
        ("body.foot.friction", -1.0, "body.foot.friction = -1.0: must be at least 0"),
        ("body.world.timestep", 0.003, "body.world.timestep = 0.003: must be a decision of 0.01 s divided by"),
    ],
)
def test_an_impossible_part_is_refused(name, value, says, hopper):
    before = dict(hopper.worker.subject.settings)
    ((kind, text),) = hopper(live.Edit(name, value))
    assert (kind, text.startswith(says)) == ("error", True), text
    assert hopper.worker.subject.settings == before
