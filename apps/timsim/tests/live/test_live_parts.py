"""The parts of a run that need no learner: shared memory, pace, history, curve, stage, bare models."""

import math
import threading
import time
from types import SimpleNamespace

import jax
import mujoco
import numpy as np
import pytest

from motorgrad.bodies import BODIES, Hexapod, Hopper, Terrain, compile_model
from motorgrad.tasks import TASKS, make
from motorgrad.training import agent_for, fingerprint
from patience import until
from timsim import live
from timsim.live._policy import save_policy
from timsim.live._records import SAMPLES_PER_SECOND, SPARSE_SAMPLES_PER_SECOND, STRETCH, SamplingBudget
from timsim.live._snapshot import POINTS, CurveRecorder, SharedArrays, Sizes, Tally, layout
from timsim.planet import Planet, ground_finder, on_planet

MUSCLE = """
<mujoco>
  <asset><mesh name="bone" file="{mesh}" scale=".1 .1 .1"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="upper" pos="0 0 1">
      <geom type="mesh" mesh="bone" mass="1"/><site name="high" pos=".05 0 0"/>
      <body name="lower" pos="0 0 -.3">
        <joint name="elbow" axis="0 1 0" range="-2 2" limited="true"/>
        <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3"/><site name="low" pos=".05 0 -.1"/>
      </body>
    </body>
  </worldbody>
  <tendon><spatial name="flexor"><site site="high"/><site site="low"/></spatial></tendon>
  <actuator>
    <general name="flexor" tendon="flexor" dyntype="muscle" gaintype="muscle" biastype="muscle" ctrllimited="true"
      ctrlrange="0 1" dynprm=".01 .04" gainprm=".75 1.05 100 200 .5 1.6 1.5 1.3 1.2"
      biasprm=".75 1.05 100 200 .5 1.6 1.5 1.3 1.2" lengthrange=".15 .35"/>
  </actuator>
</mujoco>
"""
CUBE = "\n".join(
    ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
)  # a tetrahedron


@pytest.fixture
def muscled(tmp_path):
    """A model in MyoSuite's style: a general actuator as the muscle, with activation, and a mesh."""
    (tmp_path / "bone.obj").write_text(CUBE)
    path = tmp_path / "elbow.xml"
    path.write_text(MUSCLE.format(mesh="bone.obj"))
    return path


def test_a_reader_never_sees_half_a_write():
    block = SharedArrays({"a": (4000,), "b": (4000,)})
    other, stop, seen = SharedArrays({"a": (4000,), "b": (4000,)}, block.name), threading.Event(), []

    def write():
        number = 0.0
        while not stop.is_set():
            number += 1
            with block.writing() as arrays:
                arrays["a"][:] = number
                arrays["b"][:] = number
            time.sleep(1e-4)

    writer = threading.Thread(target=write)
    writer.start()

    def seen_enough():
        read = other.read()
        both = np.concatenate([read["a"], read["b"]])
        seen.append(both[0] if both.min() == both.max() else None)
        return len(set(seen)) == 50

    enough = until(seen_enough, pause=lambda _: None)  # reads as fast as it can
    stop.set()
    writer.join()
    assert enough
    assert None not in seen
    other.close()
    block.close()


def test_a_writer_that_died_is_told(monkeypatch):
    monkeypatch.setattr("timsim.live._snapshot.PATIENCE", 0.5)
    block = SharedArrays({"a": (2,)})
    block._sequence[0] += 1
    with pytest.raises(RuntimeError, match="stopped while it was writing"):
        block.read()
    block.close()


def test_what_is_looked_at_comes_in_stretches():
    budget = SamplingBudget()
    assert budget.take(100) == 100
    assert budget.take(450) == 450
    assert budget.take(100) == 0
    budget._credit = STRETCH - 1
    budget._then += 100.0  # no time has passed
    assert budget.take(100) == 0
    budget._credit = STRETCH + SAMPLES_PER_SECOND * 100
    assert budget.take(100) == 100
    # a fast run waits for its next stretch at the lower rate
    budget._on, budget._credit = False, 0.0
    budget._then -= 0.9 * STRETCH / SPARSE_SAMPLES_PER_SECOND
    assert budget.take(1000) == 0
    budget._then -= 0.2 * STRETCH / SPARSE_SAMPLES_PER_SECOND
    assert budget.take(1000) == STRETCH


def test_a_curve_keeps_its_mean_while_it_is_thinned():
    sizes = Sizes(0, 0, 0, 0, 0, 0, 0, 0, 200, 1, 0)
    block = SharedArrays(layout(sizes)["curve"])
    curve, rewards = CurveRecorder(block, sizes, 1.0), np.random.default_rng(0).normal(size=3 * POINTS)
    for decision, reward in enumerate(rewards, 1):
        happened = decision % 3 == 0
        curve.add(decision, Tally(np.array([reward, decision]), np.array([1.0, float(happened)])), False)
    found = block.read()
    count = int(found["count"])
    assert count < POINTS
    ends = found["decision"][:count]
    assert ends[-1] == len(rewards)
    spans = np.diff(ends, prepend=0)
    assert np.sum(spans * found["values"][0, :count]) == pytest.approx(rewards.sum())
    assert found["values"][1, 0] == 3.0
    curve.drop_after(int(ends[9]))
    assert int(block.read()["count"]) == 10
    block.close()


def test_a_stage_changes_a_task_and_its_rewards_stay():
    stage = live.Stage(0.0005, (0.0, 0.0, -1.62), Terrain(height=0.02), {"far": live.Camera((3.0, 0.0, 1.0))})
    task = stage.of_task(make("hopper", penalty=0.3))
    model = compile_model(task.dynamics)
    assert model.opt.timestep == 0.0005
    assert task.substeps == 20
    assert model.opt.gravity[2] == -1.62
    assert model.nhfield == 1
    assert task.penalty == 0.3
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    away = -data.camera("far").xmat.reshape(3, 3)[:, 2]
    np.testing.assert_allclose(away, -np.array([3.0, 0.0, 1.0]) / math.hypot(3, 1), atol=1e-6)


def test_a_camera_that_follows_keeps_its_distance():
    spec = Hexapod().spec()
    live.Camera((1.0, 0.0, 0.5), follow="front").add(spec, "ahead")
    model = compile_model(spec)
    data = mujoco.MjData(model)
    for shift in (0.0, 2.0):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[0] += shift
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.camera("ahead").xpos - data.body("front").xpos, [1.0, 0.0, 0.5], atol=1e-6)


def test_every_registered_body_is_simulated_by_its_name(monkeypatch):
    monkeypatch.setitem(BODIES, "heavy-hopper", lambda: Hopper(load_mass=5.0))
    for name in {*BODIES} - {*TASKS}:  # the name of a task means its learner
        setup = live.setup_of(name)
        assert (setup.name, setup.task) == ("arm6" if name == "mjcf" else name, None)  # a model's own name
        assert setup.model.nu > 0
    assert live.setup_of("heavy-hopper").model.body("load").mass == 5.0


@pytest.mark.parametrize(
    ("make_it", "says"),
    [
        (lambda: live.Stage(gravity=(0.0, math.nan, 0.0)), "gravity[1] = nan"),
        (lambda: live.Stage(timestep=0.0), "timestep = 0.0: must be in (0, 0.1], in s"),
        (lambda: live.Camera((0.0, 0.0, 0.0)), "target = "),
        (
            lambda: live.Stage(gravity=(0.0, 0.0, -1.0)).of_task(make("chain")),
            "task = 'chain': must be a task with a body",
        ),
        (lambda: live.Camera((1.0, 0.0, 0.0), follow="fot").add(Hopper().spec(), "a"), "did you mean 'foot'"),
        (lambda: live.Camera((1.0, 0.0, 0.0)).add(Hopper().spec(), "side"), "cameras = 'side': must be other"),
        (lambda: live.Speed(0.01), "speed = 0.01: must be at least 0.05"),
        (lambda: live.Speed(math.nan), "speed = nan"),
        (lambda: live.Push("load", (1.0, 0.0), 1.0), "force = "),
        (lambda: live.Edit("agent.optimizer.learning_rate", math.nan), "agent.optimizer.learning_rate = nan"),
        (lambda: live.Save("policy.txt"), "path = 'policy.txt': must be a file ending in .npz"),
        (lambda: live.setup_of("hoper"), "unknown task or body 'hoper': did you mean 'hopper'?"),
        (lambda: live.setup_of("arm", run="runs/x"), "run = 'runs/x': must be left out"),
        (lambda: live.setup_of(3), "task = 3: must be a task, a body"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(make_it, says):
    with pytest.raises(ValueError, match=r".") as refused:
        make_it()
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_model_with_muscles_and_meshes_is_simulated(muscled, driven):
    elbow = driven(live.setup_of(muscled))
    assert elbow.worker.subject.about().muscles == ["flexor"]
    elbow(live.Control(0, 1.0), live.Step(20))
    bent = elbow.seen()
    assert bent["activation"][0, 0] > 0.9
    assert bent["control"][0, 0] == 1.0
    assert abs(bent["position"][0, 0]) > 0.03
    elbow(live.Scrub(5))
    assert elbow.seen()["decision"] == 5
    elbow(live.Step(15))
    assert np.array_equal(elbow.seen()["position"], bent["position"])
    elbow(live.Edit("body.flexor.strength", 0.0), live.Reset(), live.Control(0, 1.0), live.Step(20))
    assert abs(elbow.seen()["position"][0, 0]) < abs(bent["position"][0, 0])
    assert elbow(live.Freeze()) == [("error", "freeze: this model has no learner")]
    ((kind, text),) = elbow(live.Control(0, 2.0))
    assert (kind, text) == ("error", "control = 2.0: must be from 0 to 1")


def test_broken_models_are_told_in_one_line(muscled, tmp_path):
    broken = tmp_path / "broken.xml"
    for text, says in (
        ("<mujoco><worldbody>", "broken.xml': "),
        ("<mujoco><worldbody><body><geom size='1' typ='box'/></body></worldbody></mujoco>", "typ"),
        (MUSCLE.format(mesh="gone.obj"), "gone.obj"),
    ):
        broken.write_text(text)
        with pytest.raises(ValueError, match=r"broken\.xml") as refused:
            live.setup_of(broken)
        assert says in str(refused.value)
        assert "\n" not in str(refused.value)
    with pytest.raises(ValueError, match=r"none\.xml': must be an existing MJCF file"):
        live.setup_of(tmp_path / "none.xml")


def test_who_walks_on_a_planet_stands_on_its_ground():
    planet = Planet(radii=(3.0, 3.0, 3.0), height=0.0)
    task = on_planet(make("hexapod"), planet)
    model = compile_model(task.dynamics)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    pose = SimpleNamespace(bodies=[data], offset=np.array([[0.0, 5.0, 0.0]]))
    ground_at = ground_finder(task, model, pose)
    ground, up = ground_at(np.array([4.0, 5.0, -3.0]))  # a quarter around
    np.testing.assert_allclose(ground, [3.0, 5.0, -3.0], atol=1e-6)
    np.testing.assert_allclose(up, [1.0, 0.0, 0.0], atol=1e-6)
    assert ground_finder(make("hexapod"), model, pose) is None


def test_a_saved_policy_is_the_first_one(tmp_path):
    task = make("hopper")
    policy = agent_for(task).init(jax.random.key(3)).policy
    save_policy(str(tmp_path / "kept.npz"), policy, "hopper")
    found = live.setup_of(task, run=tmp_path / "kept.npz").initial
    assert fingerprint(found) == fingerprint(jax.tree.map(lambda leaf: np.asarray(leaf)[None], policy))
