"""Every term against MuJoCo or its formula in NumPy."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from composed_examples import BODY, MODEL, moved, task
from scipy.integrate import solve_ivp

import motorgrad as mg
from motorgrad.bodies import Mjcf
from motorgrad.learning import Agent
from motorgrad.policies import bounded_hyperplanes
from motorgrad.schema import PART_CLASSES, build, table
from motorgrad.tasks import compose, terms
from motorgrad.tasks.terms._quantities import Compartments
from motorgrad.tasks.terms._term import norm
from motorgrad.training.engines import stepper_for

DECISIONS = 12


@pytest.fixture(scope="module")
def control():
    return np.random.default_rng(0).uniform((0, -1, 0), (1, 1, 2), (DECISIONS, 3))


def carried(made, control):
    """The memory and state of one seed after decisions, and the rewards."""
    batch = made.batch([0], threads=1)
    start = np.asarray(jax.random.uniform(jax.random.key(0), (made.init_uniforms,)))
    if given := made.begin(start[None]):
        batch.reset(None, **given)
    memory, rewards, ended = made.init(jnp.asarray(start)), [], []
    memory, _ = made.observe(memory, batch.unpack(batch.packed[0]), jnp.zeros(0))
    for action in control:
        batch.step(np.asarray(made.control(jnp.asarray(action, jnp.float32), memory))[None])
        state = batch.unpack(batch.packed[0])
        memory, reward, over = made.reward(memory, state, jnp.asarray(action, jnp.float32))
        memory, seen = made.observe(memory, state, jnp.zeros(0))
        rewards.append(float(reward))
        ended.append(bool(over))
    return memory, state, np.array(seen), rewards, ended


def value(term, control, **settings):
    """A quantity at the last decision, as reward."""
    made = task(reward=[term], **settings)
    batch = made.batch([0], threads=1)
    start = np.random.default_rng(0).random(made.init_uniforms, np.float32)
    if given := made.begin(start[None]):
        batch.reset(None, **given)
    memory = made.init(jnp.asarray(start))
    for action in control:
        before = batch.unpack(batch.packed[0].copy())
        batch.step(np.asarray(made.control(jnp.asarray(action, jnp.float32), memory))[None])
    memory, _ = made.observe(memory, before, jnp.zeros(0))
    return float(made.reward(memory, batch.unpack(batch.packed[0]), jnp.asarray(action, jnp.float32))[1])


def test_observations_are_what_mujoco_says(control):
    made = task()
    seen = dict(zip(made.observation_names, carried(made, control)[2], strict=True))
    model, data, force, contact, _ = moved(control, made.substeps)
    hand = model.site("hand").id
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, hand, velocity, 0)
    wanted = {
        "shoulder": data.qpos[7],
        "elbow": data.qpos[8],
        "shoulder velocity": 0.1 * data.qvel[6],
        "elbow velocity": 0.1 * data.qvel[7],
        **{f"{name} length": data.actuator(name).length[0] for name in ("lift", "bend", "hold")},
        "lift velocity": data.actuator("lift").velocity[0],
        **{f"{name} force": force[i] for i, name in enumerate(("lift", "bend", "hold"))},
        "lift activation": data.act[0],
        **{f"hand {axis}": data.site_xpos[hand, i] for i, axis in enumerate("xyz")},
        **{f"ball {axis}": data.xpos[model.body("ball").id, i] for i, axis in enumerate("xyz")},
        **{f"hand velocity {axis}": velocity[3 + i] for i, axis in enumerate("xyz")},
        **{f"gyro {i + 1}": data.sensor("gyro").data[i] for i in range(3)},
        "ball contact": contact,
        **{f"{name} before": control[-1, i] for i, name in enumerate(("lift", "bend", "hold"))},
        "time": DECISIONS * made.period,
        "height": data.xpos[model.body("ball").id, 2],
    }
    assert seen.keys() == wanted.keys()
    assert contact > 1
    for name, number in wanted.items():
        assert seen[name] == pytest.approx(number, rel=2e-5, abs=2e-6), name


def test_quantities_are_their_formulas(control):
    model, data, *_ = moved(control, 10)
    hand = data.site("hand").xpos.copy()
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, model.site("hand").id, velocity, 0)
    place = (0.4, 0.1, 0.9)
    apart = np.linalg.norm(hand - place)
    aim = {"targets": [terms.Reach("hand", at=place)]}
    share = np.abs(control[-1]) / (1, 1, 2)
    for term, wanted in (
        (terms.Distance(), -apart),
        (terms.Distance(power=2, weight=3), 3 * apart**2),
        (terms.Closeness(width=0.2), np.exp(-(apart**2) / 0.08)),
        (terms.Within(tolerance=apart * 1.01), 1),
        (terms.Within(tolerance=apart * 0.99), 0),
        (terms.Beyond(limit=apart * 0.99, weight=-50), -50),
        (terms.Height("hand"), hand[2]),
        (terms.Upright("lower"), data.body("lower").xmat[8]),
        (terms.Upright("hand", axis="x"), data.site("hand").xmat[6]),
        (terms.Along("hand", direction=(0, 0, 2)), velocity[5]),
        (terms.Along("hand", direction=tuple(velocity[3:]), most=1e-3), 1e-3),
        (terms.Speed("hand"), -np.linalg.norm(velocity[3:])),
        (terms.Speed(joints=("shoulder", "elbow")), -np.sqrt(np.mean(data.qvel[6:] ** 2))),
        (terms.Outside("hand", low=tuple(hand + 0.01), high=tuple(hand + 0.02)), -1),
        (terms.Outside("hand", low=tuple(hand - 0.01), high=tuple(hand + 0.01)), 0),
        (terms.Effort(), -np.mean(share**2)),
        (terms.Effort(of="activation"), -(data.act[0] ** 2)),
        (terms.Effort(actuators=("bend", "hold"), root=True), -np.linalg.norm(share[1:]) / 2),
        (terms.Alive(weight=0.5), 0.5),
    ):
        assert value(term, control, **aim) == pytest.approx(wanted, rel=1e-4, abs=1e-6), term


def test_success_counts_the_decisions_within(control):
    aim = {"targets": [terms.Reach("hand", low=(-9, -9, -9), high=(9, 9, 9))], "time_limit": 0.02 * DECISIONS}
    for needed, wanted in ((DECISIONS - 1, 1), (DECISIONS, 0)):
        success = terms.Success(tolerance=100.0, decisions=needed)
        made = task(reward=[success], metrics=[success], **aim)
        memory, state, _, rewards, _ = carried(made, control)
        assert rewards[-1] == wanted
        assert rewards[0] == 0
        number, occurred = made.metrics(memory, state)["success"]
        assert (float(number), bool(occurred)) == (wanted, True)
    memory, state, *_ = carried(made, control[:-1])
    assert not made.metrics(memory, state)["success"][1]


@pytest.mark.parametrize("rest", [0.0, 0.1])
def test_fatigue_follows_its_differential_equations(rest):
    term = terms.Fatigue(fatigue=0.5, recovery=0.05, rest=15, rise=10)

    def load(t):
        return 0.7 if t < 4 else rest

    def rate(t, state):
        active, fatigued = state
        gap = load(t) - active
        drive = 10 * (min(gap, 1 - active - fatigued) if gap > 0 else gap)
        back = 0.05 * (1 if load(t) > 0.01 else 15)
        return drive - 0.5 * active, 0.5 * active - back * fatigued

    precise = {"max_step": 1e-2, "rtol": 1e-8}
    first = solve_ivp(rate, (0, 4), (0, 0), **precise).y[:, -1]
    wanted = solve_ivp(rate, (4, 8), first, **precise).y[:, -1]
    state = Compartments(jnp.zeros(1), jnp.zeros(1))
    after = jax.jit(lambda state, load: term.after(state, load, 0.02))
    for step in range(400):
        state = after(state, jnp.array([load(step * 0.02)]))
        if step == 199:
            np.testing.assert_allclose([state.active[0], state.fatigued[0]], first, rtol=0.02, atol=1e-6)
    np.testing.assert_allclose([state.active[0], state.fatigued[0]], wanted, rtol=0.02, atol=1e-6)


def test_fatigue_is_that_of_the_commanded_muscles():
    def tired(actuators, control):
        bound = terms.Fatigue(actuators, speedup=100).bind(terms.Scene(BODY, 0.02))
        now = terms.Now(None, jnp.array(control), jnp.zeros(()), {}, bound.init())
        for _ in range(5):
            now = now._replace(memory=bound.step(now))
        return float(bound.read(now))

    assert tired("lift", [1.0, 0.0, 0.0]) > 0.01
    assert tired(("lift", "bend"), [1.0, -1.0, 0.0]) == pytest.approx(tired("lift", [1.0, 0.0, 0.0]))
    assert tired("hold", [1.0, 0.0, 0.0]) == 0


def test_targets_are_drawn_for_each_episode_and_seed():
    for target, low, high in (
        (terms.Reach("hand", low=(1, 2, 3), high=(2, 2, 5)), (1, 2, 3), (2, 2, 5)),
        (terms.Pose(("shoulder", "elbow")), (-1, 0), (1, 2)),
        (terms.Pose("elbow", low=(0.5,), high=(0.6,)), 0.5, 0.6),
        (terms.Pose("elbow", at=(0.5,)), 0.5, 0.5),
    ):
        made = task(targets=[target], observe=["target"])
        drawn = np.array([made.init(u).drawn["target"] for u in np.random.default_rng(1).random((50, 3))])
        assert (drawn >= low).all()
        assert (drawn <= high).all()
        assert (np.ptp(drawn, axis=0) >= 0.7 * np.subtract(high, low)).all()
    made = task(targets=[terms.Reach("hand", joints=("shoulder", "elbow"))], observe=["target"])
    drawn = np.array([made.init(jnp.array([u])).drawn["target"] for u in np.linspace(0, 0.999, 50)])
    apart = np.linalg.norm(drawn - (0, 0, 1), axis=1)
    assert (apart < 0.6 + 1e-6).all()
    assert (apart > 0.32).all()  # the elbow bends to 2 rad
    assert len(np.unique(drawn[:, 0])) > 40


def test_targets_that_are_places_are_marked():
    follow = terms.Follow(parts="hand", time=(0.0, 1.0), values=((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)), name="path")
    two = terms.Reach(("hand", "upper"), at=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6), name="two")
    made = compose(
        "arm6",
        targets=[two, follow, terms.Pose(name="pose")],
        observe=["joint-positions"],
        reward=[terms.Within("two", 0.05), terms.Within("pose", 0.2)],
        metrics=[terms.Within("two", 0.04)],
    )
    start = made.init(jnp.zeros(made.init_uniforms))
    later = start._replace(decisions=jnp.asarray(25))
    marks = made.marks(later, None)  # wherever the body is
    expected = [(0.1, 0.2, 0.3, 0.04), (0.4, 0.5, 0.6, 0.04), (0.5, 1.0, 1.5, 0.02)]
    np.testing.assert_allclose(marks, expected, rtol=1e-6)
    assert compose("arm6", targets=["pose"], observe=["target"], reward=["distance"]).marks(start, None).shape == (0, 4)
    assert mg.make("hopper").marks((), None).shape == (0, 4)


def test_trajectories_from_numbers_and_files(tmp_path):
    time, values = (0.0, 0.1, 0.3), ((0.0, 1.0), (1.0, 1.0), (3.0, 0.0))
    table = np.column_stack([time, values])
    np.savez(tmp_path / "a.npz", time=time, values=values)
    np.savetxt(tmp_path / "a.csv", table, delimiter=",")
    np.savetxt(tmp_path / "titled.csv", table, delimiter=",", header="time,shoulder,elbow", comments="")
    joints = ("shoulder", "elbow")
    given = terms.Follow(joints=joints, time=time, values=values)
    for name in ("a.npz", "a.csv", "titled.csv"):
        assert terms.Follow(joints=joints, file=str(tmp_path / name)) == given
    moments = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.4])
    expected = np.column_stack([np.interp(moments, time, column) for column in np.transpose(values)])
    for repeats in (False, True):
        made = task(
            targets=[terms.Follow(joints=joints, time=time, values=values, repeats=repeats)], observe=["target"]
        )
        target = made._bound.scene.targets["target"]
        found = np.array([target.wanted(jnp.zeros(()), jnp.float32(t)) for t in moments])
        if repeats:
            again = np.array([np.interp((moments[4:]) % 0.3, time, column) for column in np.transpose(values)]).T
            np.testing.assert_allclose(found[:4], expected[:4], atol=1e-5)
            np.testing.assert_allclose(found[5:], again[1:], atol=1e-5)
        else:
            np.testing.assert_allclose(found, expected, atol=1e-5)
    for changes, told in (
        ({"values": values[:2]}, "values = 2: must be 3 lists of one length"),
        ({"time": (0.0, 0.2, 0.1)}, "increasing times"),
        ({"joints": ()}, "one of the two"),
        ({"file": str(tmp_path / "b.csv"), "time": (), "values": ()}, "an existing file"),
    ):
        with pytest.raises(ValueError, match=told):
            terms.Follow(**({"joints": joints, "time": time, "values": values} | changes))


def test_a_trajectory_is_where_it_is_at_the_time_of_a_decision():
    """At the first decision and at later ones: what is observed, and what the reward compares with the body."""
    time, values = (0.0, 0.1, 0.3), ((0.0, 1.0), (1.0, 1.0), (3.0, 0.0))
    follow = terms.Follow(joints=("shoulder", "elbow"), time=time, values=values, repeats=True)
    made = task(targets=[follow], observe=["target", terms.Clock(0.3)], reward=["distance"])
    start = made.init(jnp.zeros(made.init_uniforms))
    target = made._bound.scene.targets["target"]
    for decisions in (0, 1, 4, 14, 15, 45, 10**6 + 7, 50_000_003, 2**31 - 8):
        now = made._now(start._replace(decisions=jnp.asarray(decisions)), None)  # wherever the body is
        passed = decisions * 2 % 30 / 100
        expected = [np.interp(passed, time, column) for column in np.transpose(values)]
        np.testing.assert_allclose(target.at(now, "target"), expected, atol=2e-6)
        _, clock = made._bound.observe[1]
        angle = 2 * np.pi * passed / 0.3
        np.testing.assert_allclose(clock.read(now), [np.sin(angle), np.cos(angle)], atol=2e-6)


def test_episodes_begin_where_the_resets_say():
    made = task(reset=[terms.Keyframe(("high",)), terms.Noise(("shoulder",), position=0.1, velocity=0.2)])
    uniforms = np.random.default_rng(2).random((400, made.init_uniforms))
    start = made.begin(uniforms)
    assert start["position"][:, 8] == pytest.approx(0.9)
    assert start["position"][:, 7].mean() == pytest.approx(-0.3, abs=0.02)
    assert start["position"][:, 7].std() == pytest.approx(0.1, rel=0.1)
    assert start["velocity"][:, 6].std() == pytest.approx(0.2, rel=0.1)
    assert not start["velocity"][:, :6].any()
    made = task(reset=[terms.RandomJoints(("elbow", "shoulder"), share=0.5), terms.Noise("elbow", position=9.0)])
    start = made.begin(np.random.default_rng(3).random((400, made.init_uniforms)))["position"]
    assert np.abs(start[:, 7]).max() <= 0.5
    assert np.abs(start[:, 7]).max() > 0.45
    assert {start[:, 8].min(), start[:, 8].max()} == {0.0, 2.0}  # noise stays in the range
    assert start[:, :7] == pytest.approx(np.tile(BODY.model.key_qpos[0, :7], (400, 1)))
    both = task(reset=["keyframe"])
    drawn = both.begin(np.random.default_rng(4).random((50, both.init_uniforms)))["position"][:, 7]
    assert set(np.round(drawn, 3)) == {0.3, -0.3}
    assert task().begin(np.zeros((3, 0))) == {}


def test_a_keyframe_gives_the_activations_too_and_needs_no_random_number():
    body = Mjcf(MODEL.replace(".3 .2", '.3 .2" act=".7'), start="high")
    made = task(body=body, reset=[terms.Keyframe(("low",))], observe=["joint-positions", "activations"])
    assert made.init_uniforms == 0
    batch = made.batch([0, 1], threads=1)
    batch.reset(None, **made.begin(np.zeros((2, 0), np.float32)))
    assert batch.packed[:, 7] == pytest.approx(0.3)
    assert batch.unpack(batch.packed).activation == pytest.approx(0.7)


@pytest.mark.slow
@pytest.mark.ci
def test_every_environment_of_a_learner_starts_in_its_own_state():
    made = task(
        reset=[terms.RandomJoints(("shoulder", "elbow"))],
        targets=[terms.Pose("elbow")],
        observe=["target", terms.JointPositions("elbow")],
    )
    run = stepper_for(made, Agent(bounded_hyperplanes(made)), [0, 1], threads=1, envs=3)
    starts = run.batch.unpack(run.batch.packed).position[:, 8]
    assert len(np.unique(starts)) == 6
    seen = np.array(run.program.unpack(run._cycles).observation).reshape(6, 2)
    np.testing.assert_allclose(seen[:, 1], starts, rtol=1e-6)  # what is observed first is where it starts
    assert len(np.unique(seen[:, 0])) == 6


def test_terms_end_episodes(control):
    for term, wanted in (
        (terms.Height("hand", below=5.0), True),
        (terms.Height("hand", below=-5.0), False),
        (terms.Outside("hand", low=(5, 5, 5), high=(6, 6, 6)), True),
        (terms.Distance(above=0.01), True),
    ):
        made = task(terminate=[term], targets=[terms.Reach("hand", at=(9, 9, 9))])
        assert made.episodic
        assert carried(made, control[:2])[4] == [wanted] * 2
    assert not task().episodic
    with pytest.raises(ValueError, match="terminate: distance = 'no limit': must be above or below a limit"):
        task(terminate=["distance"], targets=["reach"])


@pytest.fixture
def registry():
    """The registered terms, put back afterwards."""
    before = {base: dict(kinds) for base, kinds in PART_CLASSES.items()}
    yield
    for base, kinds in before.items():
        PART_CLASSES[base].clear()
        PART_CLASSES[base].update(kinds)


def test_an_observation_of_one_number_has_the_name_of_its_kind(registry):
    @terms.register(terms.Observation, "passed")
    def passed(scene):
        return lambda now: now.time

    assert task(observe=["passed"]).observation_names == ("passed",)


def test_a_term_of_ones_own_is_one_function_and_one_line(registry, control):
    @terms.register(terms.Quantity, "apart")
    def apart(scene, first: str, second: str, factor: float = 1.0):
        one, two = scene.point(first), scene.point(second)
        return lambda now: factor * norm(one(now.state) - two(now.state))

    @terms.register(terms.Observation, "middle")
    def middle(scene, part: str = "mid"):
        point = scene.point(part)
        return terms.Bound(lambda now: point(now.state), ("x", "y", "z"))

    @terms.register(terms.Reset, "bent")
    def bent(scene, angle: float):
        place = scene.positions("elbow")[1]

        def apply(start, uniforms):
            start.position[:, place] = angle
            return start

        return terms.BoundReset(0, apply)

    made = task(
        observe=["middle", {"kind": "apart", "first": "hand", "second": "mid"}],
        reward=[apart("hand", "mid", 2.0, weight=-1.0)],
        reset=[bent(0.4)],
    )
    _, _, seen, rewards, _ = carried(made, control)
    assert made.observation_names == ("x", "y", "z", "apart")
    assert rewards[-1] == pytest.approx(-2 * seen[3])
    assert made.begin(np.zeros((1, 0)))["position"][0, 8] == pytest.approx(0.4)
    assert build(type(made), table(made), "task") == made
    with pytest.raises(ValueError, match=r"rewards\[0\] 'frist': did you mean 'first'"):
        task(reward=[{"kind": "apart", "frist": "hand", "second": "mid"}])
    with pytest.raises(ValueError, match=r"rewards\[0\].*second"):
        task(reward=[{"kind": "apart", "first": "hand"}])
    with pytest.raises(ValueError, match="name = 'apart': must be another name"):
        terms.register(terms.Quantity, "apart", lambda scene: None)
    with pytest.raises(ValueError, match=r"base = .*: must be one of Observation, Target, Quantity, Reset"):
        terms.register(terms.Bound, "apart", apart)


def test_every_term_has_a_page_of_arguments():
    for base in (terms.Observation, terms.Target, terms.Quantity, terms.Reset):
        for name, kind in PART_CLASSES[base].items():
            assert "**Arguments:**" in kind.__doc__, name


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"observe": [terms.JointPositions("elbows")]},
            "observe: joint-positions: unknown joint 'elbows': did you mean 'elbow'",
        ),
        ({"observe": ["joint-position"]}, r"observations\[0\] 'joint-position': did you mean 'joint-positions'"),
        ({"observe": ["target-error"]}, "observe: target-error: unknown target 'target'"),
        ({"observe": [terms.Activations("bend")]}, "unknown actuator with an activation 'bend'"),
        ({"observe": [terms.SensorReadings("giro")]}, "unknown sensor 'giro': did you mean 'gyro'"),
        ({"observe": [{"kind": "positions", "part": "hand"}]}, r"unknown setting .* 'part': did you mean 'parts'"),
        ({"observe": []}, "at least one term"),
        ({"reward": []}, "at least one term"),
        ({"targets": [terms.Reach("hnd")]}, "targets: reach: unknown site, body or geom 'hnd': did you mean 'hand'"),
        ({"targets": [terms.Reach("hand", at=(1, 2))]}, "at = .*: must be 3 numbers"),
        ({"targets": [terms.Pose("ball")]}, "joint = 'ball': must be a hinge or slide with a range"),
        ({"targets": ["reach", "reach"]}, "name of a target = 'target': must be given once"),
        ({"reset": [terms.Keyframe(("lw",))]}, "reset: keyframe: unknown keyframe 'lw': did you mean 'low'"),
        ({"metrics": ["alive", "alive"]}, "name of a metric = 'alive': must be given once"),
        ({"groups": ["lft"]}, "unknown actuator 'lft': did you mean 'lift'"),
        ({"groups": [("lift", "bend")]}, r"the same for all actuators of one unit"),
        ({"action_period": 0.003}, "action_period"),
        ({"body": "arn6"}, "unknown body 'arn6': did you mean 'arm6'"),
        ({"body": ""}, "unknown body ''"),
        ({"body": "hoper"}, "unknown body 'hoper': did you mean 'hopper'"),
        ({"observe": ["positions"]}, "observe: positions: parts = .*: must be the name of a site, body or geom"),
        ({"observe": ["contacts"]}, "observe: contacts: parts = .*: must be the name of a site, body or geom"),
        ({"reward": ["height"]}, "reward: height: part = '': must be the name of a site, body or geom"),
        ({"observe": [{"kind": "clock", "period": -1.0}]}, r"period = -1.0: must be a finite number of at least 0"),
    ],
)
def test_what_does_not_exist_is_refused_with_the_nearest_name(changes, told):
    with pytest.raises(ValueError, match=told):
        task(**changes)
