"""MyoSuite's posing and reaching tasks, rebuilt: the same as MyoSuite's own environments, which these tests run."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import sys
import tomllib

import jax
import mujoco
import numpy as np
import pytest
import tomli_w

import motorgrad as mg
from motorgrad._myosuite import composing, environment
from motorgrad.bodies import Mjcf
from motorgrad.bodies.mjcf import _mjcf as mjcf
from motorgrad.schema import build, table

ELBOW, FINGER, REACH = "myoElbowPose1D6MRandom-v0", "myoFingerPoseRandom-v0", "myoFingerReachRandom-v0"
MOTORS, EXOSKELETON = "motorFingerReachRandom-v0", "myoElbowPose1D6MExoFixed-v0"
HAND, ARM, FIXED = "myoHandReachRandom-v0", "myoArmReachRandom-v0", "myoHandPose3Fixed-v0"
FALLING = "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
CASES = [
    pytest.param(FINGER, 3),
    pytest.param(MOTORS, 3),
    *(pytest.param(name, 100, marks=[pytest.mark.slow, pytest.mark.ci]) for name in (ELBOW, REACH)),
    *(pytest.param(name, 2, marks=[pytest.mark.slow, pytest.mark.ci]) for name in (EXOSKELETON, HAND, FIXED)),
    pytest.param(ARM, 2, marks=pytest.mark.slow),  # MyoSuite takes ten seconds to make it
    pytest.param(FINGER, 100, marks=pytest.mark.slow),
]


needs_myosuite = pytest.mark.needs("motorgrad[myosuite]")


def played(task, env_id, episodes, seed=0):
    """The same random episodes here and in MyoSuite: pairs of observations, rewards, `solved`, ends and controls.

    Both begin in our pose with our target, and MyoSuite's controls drive both: exponentials of single precision may
    differ in their last digit, which a finger with wrapped tendons magnifies within an episode.
    """
    theirs = environment(env_id)
    rng, batch = np.random.default_rng(seed), task.batch([0])
    unpack, row = batch.unpack, np.zeros(1, int)

    def follow(memory, packed, actions):
        def step(memory, now):
            state = unpack(now[0])
            memory, reward, ended = task.reward(memory, state, now[1])
            memory, seen = task.observe(memory, state, np.zeros(0))
            return memory, (seen, reward, ended, task.metrics(memory, state)["solved"][0])

        return jax.lax.scan(step, memory, (packed, actions))[1]

    follow, look = jax.jit(follow), jax.jit(lambda memory, packed: task.observe(memory, unpack(packed), np.zeros(0)))
    found = {name: ([], []) for name in ("observation", "reward", "ended", "solved", "control")}
    for _ in range(episodes):
        uniforms = rng.random(task.init_uniforms, np.float32)
        memory = task.init(uniforms)
        batch.reset(row, **task.begin(uniforms[None]))
        theirs.reset()
        begin(theirs, batch, memory.drawn["target"])
        memory, first = look(memory, batch.packed[0])
        found["observation"][0].append(np.asarray(first)[None])
        found["observation"][1].append(theirs.get_obs()[None])
        actions = rng.uniform(-1.2, 1.2, (task.episode_limit, theirs.model.nu)).astype(np.float32)
        told, controls, packed = [], [], []
        for action in actions:
            observation, reward, terminated, _, info = theirs.step(action)
            told.append((observation, reward, terminated, info["solved"]))
            controls.append(theirs.data.ctrl.copy())
            batch.step(controls[-1][None])
            packed.append(batch.packed[0].copy())
            if terminated:
                break
        made = len(told)
        seen, rewards, ends, solved = follow(memory, np.stack(packed), actions[:made])
        ours = (seen, rewards, ends, solved, jax.jit(task.control)(actions[:made]))
        for name, value, wanted in zip(found, ours, (*zip(*told, strict=True), controls), strict=True):
            found[name][0].append(np.asarray(value))
            found[name][1].append(np.asarray(wanted))
    return {name: tuple(map(np.concatenate, pair)) for name, pair in found.items()}


def begin(theirs, batch, target):
    """Put MyoSuite's environment where ours begins, with the same target."""
    state, target = batch._batch, np.asarray(target, float)
    theirs.data.qpos[:], theirs.data.qvel[:] = state.bind("qpos")[0], state.bind("qvel")[0]
    if hasattr(theirs, "pose_thd"):
        theirs.target_jnt_value = target
    else:
        theirs.model.site_pos[theirs.target_sids] = target.reshape(-1, 3)
    mujoco.mj_forward(theirs.model, theirs.data)


@pytest.mark.parametrize(("env_id", "episodes"), CASES)
@needs_myosuite
def test_a_rebuilt_task_is_myosuites_own(env_id, episodes):
    task = mg.tasks.myosuite(env_id, scaling="none")
    found = played(task, env_id, episodes)
    for name in ("ended", "solved"):
        ours, theirs = found[name]
        assert np.array_equal(ours > 0.5, theirs), name
    np.testing.assert_allclose(*found["observation"], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(*found["reward"], rtol=1e-6, atol=1e-6)  # single precision of rewards up to 50
    np.testing.assert_allclose(*found["control"], rtol=0, atol=3e-7)


@pytest.mark.parametrize("env_id", [FINGER, pytest.param(HAND, marks=[pytest.mark.slow, pytest.mark.ci])])
@needs_myosuite
def test_targets_are_drawn_as_myosuite_draws_them(env_id):
    task, theirs, count = mg.tasks.myosuite(env_id), environment(env_id), 500
    numbers = np.random.default_rng(0).random((count, task.init_uniforms), np.float32)
    ours, wanted = np.asarray(jax.vmap(lambda uniforms: task.init(uniforms).drawn["target"])(numbers)), []
    for seed in range(count):
        theirs.reset(seed=seed)
        posed = hasattr(theirs, "pose_thd")
        wanted.append(theirs.target_jnt_value if posed else theirs.model.site_pos[theirs.target_sids].ravel())
    spread = np.std(wanted, axis=0)
    assert (np.abs(ours.mean(0) - np.mean(wanted, axis=0)) < 4 * spread * (2 / count) ** 0.5).all()
    np.testing.assert_allclose(ours.std(0), spread, rtol=0.15)


@needs_myosuite
def test_places_to_reach_are_reachable_and_differ():
    task = mg.tasks.myosuite(REACH)
    numbers = np.random.default_rng(0).random((200, task.init_uniforms), np.float32)
    places = np.asarray(jax.vmap(lambda uniforms: task.init(uniforms).drawn["target"])(numbers))
    low, high = environment(REACH).target_reach_range["IFtip"]
    assert (places >= np.array(low) - 1e-6).all()
    assert (places <= np.array(high) + 1e-6).all()
    assert (places.std(0) > 0.01).all()


@needs_myosuite
def test_episodes_begin_as_in_myosuite():
    def starts(env_id):
        task = mg.tasks.myosuite(env_id)
        return task.begin(np.random.default_rng(0).random((1000, task.init_uniforms), np.float32))["position"]

    np.testing.assert_array_equal(starts(FINGER), np.tile(environment(FINGER)._init_qpos, (1000, 1)))
    drawn, (low, high) = starts(ELBOW), environment(ELBOW).model.jnt_range[0]
    assert low <= drawn.min() < low + 0.02
    assert high - 0.02 < drawn.max() <= high


@needs_myosuite
def test_muscles_that_are_on_or_off_take_myosuites_extreme_commands():
    task = mg.tasks.myosuite(FINGER, actions="binary")
    assert task.action_size == 5
    np.testing.assert_allclose(task.control(np.eye(5, dtype=np.float32))[0], [0.9241418, *[0.00055278] * 4], rtol=1e-5)


@needs_myosuite
def test_a_run_describes_its_task_by_the_id(tmp_path):
    task = mg.tasks.myosuite(FINGER)
    text = tomli_w.dumps(table(task))
    assert FINGER in text
    assert len(text) < 3_000
    assert build(type(task), tomllib.loads(text)) == task
    with pytest.raises(ValueError, match="checksum"):
        Mjcf(f"myosuite:{FINGER}", checksum="0" * 32)


@needs_myosuite
def test_unknown_ids_name_the_nearest():
    with pytest.raises(ValueError, match=f"did you mean '{ELBOW}'"):
        mg.tasks.myosuite("myoElbowPose1D6MRandm-v0")
    with pytest.raises(ValueError, match="unknown posing or reaching task of MyoSuite"):
        mg.tasks.myosuite("myoElbowPose1D6MExoRandom-v0")  # another weight in every episode
    with pytest.raises(ValueError, match=f"did you mean '{FINGER}'"):
        Mjcf("myosuite:myoFingerPoseRndom-v0")


@needs_myosuite
def test_an_environment_of_myosuite_is_a_gymnasium_task():
    task = mg.tasks.from_gymnasium(FINGER)
    assert task.period == pytest.approx(0.02)
    assert task.observation_size == 17


@needs_myosuite
def test_the_learner_is_chosen_by_the_goal_and_the_actions():
    for how, preset in (({}, "sac"), ({"scaling": "none"}, "sac"), ({"actions": "binary"}, "natural")):
        choice = mg.training.choice_for(mg.tasks.myosuite(ELBOW, **how))
        assert choice is not None
        assert choice.preset == preset
    assert mg.agent_for(mg.tasks.myosuite(ELBOW)).replay.hindsight is not None


@pytest.mark.slow
@needs_myosuite
def test_with_replay_and_hindsight_an_elbow_holds_its_poses():
    """With the filter of noise that lasts for 100 ms, it would swing about them, and half of the steps be off."""
    task = mg.tasks.myosuite(ELBOW, actions="continuous")
    run = mg.train(task, steps=12_000, seeds=1, progress=False)
    metrics = mg.evaluate(run, 2_000, mode="mode").metrics
    assert metrics["success"][0] == 1
    assert metrics["solved"][0] > 0.85


@pytest.mark.parametrize(
    "make", [mg.tasks.myosuite, mg.tasks.from_gymnasium, lambda env_id: Mjcf(f"myosuite:{env_id}")]
)
def test_without_the_extra_the_error_has_the_command(monkeypatch, make):
    import gymnasium

    environment.cache_clear()
    mjcf._of_myosuite.cache_clear()
    monkeypatch.setitem(sys.modules, "myosuite", None)
    monkeypatch.delitem(gymnasium.registry, FINGER, raising=False)
    with pytest.raises(ValueError, match=r"MyoSuite is not installed .*: pip install 'motorgrad\[myosuite\]'"):
        make(FINGER)


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: Mjcf(f"myosuite:{HAND}"), id="environment"),
        pytest.param(lambda: Mjcf("myosuite:myohand_r"), id="model"),
        pytest.param(lambda: mg.tasks.make_environment(HAND, {}), id="gymnasium"),
    ],
)
def test_how_myosuite_composes_its_models_is_not_told(make, monkeypatch, tmp_path, capfd):
    pytest.importorskip("myosuite", reason="needs motorgrad[myosuite]")
    monkeypatch.chdir(tmp_path)
    environment.cache_clear()
    mjcf._of_myosuite.cache_clear()
    make()  # without a warning, or this fails
    assert "WARNING" not in "".join(capfd.readouterr())
    assert not list(tmp_path.iterdir())  # MuJoCo's log


def test_only_the_warning_of_parts_without_a_prefix_is_hidden(recwarn):
    def attach():
        spec = mujoco.MjSpec()
        spec.attach(mujoco.MjSpec(), prefix="", frame=spec.worldbody.add_frame())
        return spec

    told, before = [], mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(told.append)
    try:
        with composing():
            attach().compile()
            falling = mujoco.MjModel.from_xml_string(FALLING)
            data = mujoco.MjData(falling)
            data.qvel[:] = np.nan
            mujoco.mj_step(falling, data)
        with composing(of_myosuite=False):
            attach()
    finally:
        mujoco.set_mju_user_warning(before)
    assert [message.split()[0] for message in told] == ["Nan,", "Attaching"]
    assert not recwarn.list
