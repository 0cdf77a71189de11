"""A policy that leaves its task is whole: every way out gives, in the raw environment, what `evaluate` gives."""

# pyright: reportOptionalMemberAccess=false, reportMissingImports=false, reportArgumentType=false
# pyright: reportCallIssue=false
# (A run that was learned here has an interface; extras may be missing; NumPy takes pairs of numbers as arrays.)

import dataclasses
import functools
import json

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from whole_examples import CASES, learned, task_of

import motorgrad as mg
import timlab
from compiled_c import CompiledC, needs_compiler
from motorgrad._random import draw_block, key_of
from motorgrad.environments import TaskEnv
from motorgrad.export import read
from motorgrad.policies import Actor, Interface, abilities, with_interface
from motorgrad.policies._export import functions, programs

STEPS = {"CartPole": 60}
FRESH = 1_000_000_000  # added to seeds by `evaluate`


class Numbers:
    """In place of an environment's generator: the numbers with which `evaluate` begins."""

    def __init__(self, task, seed):
        self._numbers = np.asarray(jax.random.uniform(key_of(seed, "start-memory"), (task.init_uniforms,)))

    def random(self, size, dtype):
        return self._numbers[:size].astype(dtype)


def begun(name, seed):
    """The raw environment as `evaluate` begins it, and its first observation."""
    task = task_of(name)
    if isinstance(task, mg.tasks.Gymnasium):
        environment = gymnasium.make(task.env_id.removeprefix("myosuite:"))
        return environment, environment.reset(seed=seed)[0]
    environment = TaskEnv(task)
    environment.np_random = Numbers(task, jnp.int32(seed))
    return environment, environment.reset()[0]


def earned(name, act, seed=5):
    """The mean reward of a policy in the raw environment, with the mean length of episodes where they end. `act` is
    given raw observations."""
    environment, observation = begun(name, seed + FRESH)
    rewards, lengths, begin = [], [], 0
    for step in range(1, STEPS.get(name, 12) + 1):
        observation, reward, terminated, truncated, _ = environment.step(act(observation))
        rewards.append(float(reward))
        if terminated or truncated:
            lengths.append(step - begin)
            observation, begin = environment.reset()[0], step
    environment.close()
    return np.mean(rewards), np.mean(lengths) if lengths else 0.0


@functools.cache
def evaluated(name):
    found = mg.evaluate(learned(name), STEPS.get(name, 12), mode="mode")
    length = found.metrics.get("length", np.full(2, np.nan))[1]
    return float(found.reward[1]), float(np.nan_to_num(length))


def spoilt(name):
    """What the policy earns without its scale: so that a comparison could fail."""
    policy, code = with_interface(learned(name).policy(5), None), learned(name).policies.interface.actions

    def act(observation):
        seen = np.ravel(observation)
        seen = np.append(seen, 1.0) if policy.observation_size > seen.size else seen
        return code.native(policy.mode(jnp.asarray(seen, jnp.float32)))

    return earned(name, act)


@pytest.mark.parametrize("name", CASES)
def test_a_run_acts_in_the_raw_environment_as_it_is_evaluated(name):
    run = learned(name)
    np.testing.assert_allclose(earned(name, lambda seen: run.act(seen, seed=5)), evaluated(name), rtol=2e-5)


@pytest.mark.parametrize("name", CASES)
def test_an_exported_policy_acts_in_the_raw_environment_as_it_is_evaluated(name, tmp_path):
    run = learned(name)
    exported = read(run.policy(5).export(tmp_path / "policy.npz", only=["mode"]))
    space = begun(name, 0)[0].action_space

    def act(observation):
        action = exported["mode"](observation=np.ravel(observation))["action"]
        return action.reshape(space.shape).astype(space.dtype)

    np.testing.assert_allclose(earned(name, act), evaluated(name), rtol=2e-5)
    own = run.policies.interface
    if name != "hopper":  # whose observations are scaled in the world itself
        assert np.max(np.abs(np.subtract(spoilt(name), evaluated(name)))) > 1e-3
    assert Interface.of_table(exported.interface).actions == own.actions


def test_drawn_actions_are_those_of_an_evaluation_too(tmp_path):
    run = learned("Pendulum")
    policy = run.policy(5)
    drawn = draw_block(jnp.asarray([5 + FRESH], jnp.int32), "policy", np.uint32(0), policy.uniforms)[:12, :, 0]
    exported = read(policy.export(tmp_path / "policy.npz", only=["sample"]))["sample"]
    wanted = mg.evaluate(run, 12, mode="sample").reward[1]
    ways = {
        "act": lambda seen, numbers: run.act(seen, 5, numbers),
        "exported": lambda seen, numbers: exported(observation=seen, uniforms=numbers)["action"],
    }
    for act in ways.values():
        numbers = iter(np.asarray(drawn))
        found = earned("Pendulum", lambda seen, act=act, numbers=numbers: act(seen, next(numbers)))
        np.testing.assert_allclose(found[0], wanted, rtol=2e-5)


@needs_compiler
@pytest.mark.parametrize("name", ["Pendulum", "CartPole", "arm"])
def test_c_source_takes_raw_observations_and_says_what_they_are(name, tmp_path):
    policy, observation = learned(name).policy(5), np.asarray(begun(name, 5)[1])
    call = CompiledC(programs({"mode": functions(policy)["mode"]}), tmp_path)
    found = call("mode", {"observation": observation})["action"]
    np.testing.assert_allclose(found, learned(name).act(observation, 5), rtol=1e-5, atol=1e-7)
    text = policy.export(tmp_path / "own.c", only=["mode"]).read_text()
    for place, seen in enumerate(policy.interface.observations.names):
        assert f"[{place}] {seen}\n" in text


@pytest.mark.needs("motorgrad[onnx]")
@pytest.mark.parametrize("name", ["Pendulum", "CartPole", "arm"])
def test_an_onnx_model_takes_raw_observations_and_says_what_they_are(name, tmp_path):
    import onnx
    import onnxruntime

    run = learned(name)
    path, observation = run.policy(5).export(tmp_path / "policy.onnx", only=["mode"]), begun(name, 5)[1]
    found = onnxruntime.InferenceSession(path).run(["mode"], {"observation": np.asarray(observation, np.float32)})[0]
    np.testing.assert_allclose(found, run.act(observation, 5), rtol=1e-5, atol=1e-7)
    told = {each.key: each.value for each in onnx.load(path).metadata_props}
    assert Interface.of_table(json.loads(told["interface"])).observations == run.policies.interface.observations


class Unit:
    """A Functional Mock-up Unit of a policy, a step for each decision."""

    def __init__(self, policy, path):
        import fmpy
        from fmpy.fmi2 import FMU2Slave

        timlab.write_fmu(policy, path)
        about = fmpy.read_model_description(str(path))
        self.variables = {each.name: each for each in about.modelVariables}
        self.given, self.shown = (
            [each.valueReference for each in about.modelVariables if each.causality == kind]
            for kind in ("input", "output")
        )
        name = about.coSimulation.modelIdentifier
        folder = fmpy.extract(str(path), str(path.with_suffix("")))
        self.unit = FMU2Slave(guid=about.guid, modelIdentifier=name, unzipDirectory=folder, instanceName="one")
        self.unit.instantiate()
        self.unit.setupExperiment(startTime=0.0)
        self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()
        self.time, self.period = 0.0, policy.interface.period

    def act(self, observation):
        self.unit.setReal(self.given, np.ravel(observation).tolist())
        whole = next(each for each in self.variables.values() if each.causality == "output").type == "Integer"
        action = (self.unit.getInteger if whole else self.unit.getReal)(self.shown)
        self.unit.doStep(self.time, self.period)
        self.time += self.period
        return np.array(action)


@pytest.mark.needs("motorgrad[fmi]")
@pytest.mark.parametrize("name", ["Pendulum", "CartPole"])
def test_a_mock_up_unit_acts_in_the_raw_environment_as_it_is_evaluated(name, tmp_path):
    unit = Unit(learned(name).policy(5), tmp_path / "policy.fmu")
    space = begun(name, 0)[0].action_space
    found = earned(name, lambda seen: unit.act(seen).astype(space.dtype).reshape(space.shape))
    np.testing.assert_allclose(found, evaluated(name), rtol=2e-5)
    for place, seen in enumerate(learned(name).policies.interface.observations.names):
        assert unit.variables[f"observation[{place}]"].description == seen


@pytest.mark.needs("motorgrad[fmi]")
def test_a_mock_up_unit_keeps_the_memory_of_a_policy(tmp_path):
    policy = mg.train("t-maze", steps=200, progress=False).policy()
    unit, actor, rng = Unit(policy, tmp_path / "policy.fmu"), Actor(policy), np.random.default_rng(0)
    for observation in rng.random((8, policy.observation_size)):
        np.testing.assert_array_equal(unit.act(observation)[0], actor.act(observation))
    with pytest.raises(ValueError, match="interface = 'model exchange': must be 'co-simulation' for a policy"):
        timlab.write_fmu(policy, tmp_path / "other.fmu", interface="model exchange")


def test_names_from_elsewhere_do_not_end_the_comment_of_a_c_file(tmp_path):
    policy = learned("Pendulum").policy()
    code = policy.interface.observations
    names = ("*/ int x; /*", "two\nlines", "trigraph ??/")
    evil = Interface(dataclasses.replace(code, names=names), policy.interface.actions)
    text = with_interface(policy, evil).export(tmp_path / "policy.c").read_text()
    comment = text[: text.index("*/")]
    assert "#include" not in comment
    assert all(line.startswith((" *", "/*")) for line in comment.splitlines()[:-1])
    assert "-lm" in comment


def test_many_observations_are_acted_on_at_once():
    run = learned("arm")
    observations = np.random.default_rng(1).normal(size=(2, 3, 7))
    found = run.act(observations)
    assert found.shape == (2, 3, 6)
    np.testing.assert_allclose(found[1, 2], run.act(observations[1, 2]), rtol=1e-6)
    assert learned("CartPole").act(np.zeros((3, 4))).shape == (3,)
    with pytest.raises(ValueError, match=r"observation\.shape = \(6,\): must be \(7,\), after any axes"):
        run.act(np.zeros(6))
    with pytest.raises(ValueError, match=r"observation = .*nan.*: must be finite numbers"):
        run.act(np.full(7, np.nan))


def test_a_policy_with_a_memory_acts_by_an_actor_that_keeps_it():
    run = mg.train("t-maze", steps=200, progress=False)
    with pytest.raises(ValueError, match=r"without a memory; run\.actor\(seed\) keeps it"):
        run.act(np.zeros(run.task.observation_size))
    policy, actor = run.policy(), run.actor()
    memory, rng = abilities.initial_memory(policy), np.random.default_rng(0)
    for _ in range(6):
        observation, uniforms = rng.random(policy.observation_size), jnp.asarray(rng.random(policy.uniforms))
        seen = abilities.observation_with_memory(policy, memory, jnp.asarray(observation, jnp.float32))
        action = policy.sample(seen, uniforms)
        memory = abilities.remember(policy, seen, action)
        np.testing.assert_array_equal(actor.act(observation, uniforms), abilities.task_action(policy, action))
    before = np.asarray(actor.memory)
    actor.reset()
    assert not np.array_equal(actor.memory, before)


def test_a_policy_that_belongs_to_no_task_is_refused_by_name():
    with pytest.raises(ValueError, match=r"without an interface.*: must be one of a run, run\.policy\(seed\)"):
        mg.policies.hyperplanes(mg.make("hopper")).act(np.zeros(3))
    running = with_interface(learned("arm").policy(), learned("arm").policies.interface.with_statistics(None))
    with pytest.raises(ValueError, match="without the running statistics of its observations"):
        running.act(np.zeros(7))
