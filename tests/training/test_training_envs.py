"""Several environments that feed one learner, in this process, in workers and as bodies."""

import os
import re
import subprocess
import sys
import time
from typing import Any

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium import spaces
from training_examples import PLAIN

import motorgrad as mg
from motorgrad._random import draw_block
from motorgrad.cli import main
from motorgrad.learning import FisherMetric, LeastSquares, LinearCritic, RootMeanSquare, Transition, gae
from motorgrad.tasks import from_gymnasium
from motorgrad.training import RunDirectoryError, stepper_for
from motorgrad.training.engines._host import seed_of

SEEDS = [3, 8]


class Drift(gymnasium.Env):
    """A number that random pushes and the action move; an episode ends beyond 1, or is cut."""

    observation_space = spaces.Box(-np.inf, np.inf, (2,))
    action_space = spaces.MultiBinary(2)

    def __init__(self, fails_at=None, ends_process_at=None):
        self.place, self.time, self.total = 0.0, 0, 0
        self.fails_at, self.ends_process_at = fails_at, ends_process_at

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.time = self.np_random.uniform(-0.5, 0.5), 0
        return np.array([self.place, 1]), {}

    def step(self, action):
        self.total += 1
        if self.total == self.fails_at:
            raise LookupError("no more steps")
        if self.total == self.ends_process_at:
            raise SystemExit(7)
        self.place += 0.3 * (action[0] - 0.5) + self.np_random.normal(0, 0.1)
        self.time += 1
        return np.array([self.place, 1]), -abs(self.place), abs(self.place) > 1, self.time == 25, {"solved": True}


@pytest.fixture(scope="module")
def drift():
    gymnasium.register("Drift-v0", lambda **settings: Drift(**settings), disable_env_checker=True)
    yield "Drift-v0"
    del gymnasium.registry["Drift-v0"]


@pytest.fixture(scope="module")
def task(drift):
    return from_gymnasium(drift)


def engine(task, agent=None, **settings) -> Any:
    """The engine of a learner of these seeds."""
    return stepper_for(task, agent or mg.agent_for(task), SEEDS, **settings)


def natural(task, batch=30):
    """A learner with every part that an environment could have for itself, or share."""
    critic = LinearCritic(discount=0.9, fit=LeastSquares(rate=0.01, interval=batch))
    estimator = gae(critic, update_every=batch)
    estimator = mg.learning.Estimator(
        estimator.trace, critic, update_every=batch, normalization=RootMeanSquare(0.01), entropy=0.01
    )
    return mg.Agent(mg.policies.hyperplanes(task), estimator, mg.learning.SGD(0.1), FisherMetric(0.02, kl=0.05))


@pytest.fixture(scope="module")
def agent(task):
    return natural(task)


def alive(process):
    """Whether a process runs."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def same(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


@pytest.mark.ci
def test_one_learner_learns_from_the_decisions_of_its_environments_in_turn(task, agent):
    envs, ticks = 3, 60
    stepper: Any = stepper_for(task, agent, [5], envs=envs)
    stepper.advance(envs * ticks)

    # the same by hand: one learner, of which everything but what `restart` clears is handed on
    batch = task.batch([seed_of(5, e) for e in range(envs)])
    state = agent.init(jax.random.key(0))
    own: dict[Any, Any] = dict.fromkeys(range(envs), state)
    memory = task.init(jnp.zeros(0))
    act, observe, update, restart = map(eqx.filter_jit, (agent.act, agent.observe, agent.update, agent.restart))
    seen = {}

    def shared_with(e, state):
        """The newest state of the learner with trace, decision and critic's episode of one environment."""
        mine = own[e].estimator
        critic, his = state.estimator.baseline, mine.baseline
        critic = critic._replace(
            features=his.features, previous=his.previous, fit=critic.fit._replace(trace=his.fit.trace)
        )
        estimator = state.estimator._replace(trace=mine.trace, baseline=critic, weight=mine.weight)
        return state._replace(estimator=estimator, decision=own[e].decision)

    numbers = np.asarray(draw_block(np.array([5]), "policy", jnp.uint32(0), envs * 2))[:, :, 0].reshape(-1, envs, 2)
    rows, unpack = batch.packed.copy(), batch.unpack
    for e in range(envs):
        memory, seen[e] = task.observe(memory, unpack(jnp.asarray(rows[e])), jnp.zeros(0))
    actions = np.zeros((envs, 2), np.float32)
    for e in range(envs):
        own[e], action = act(shared_with(e, state), seen[e], numbers[0, e])
        state, actions[e] = own[e], action
    for tick in range(1, ticks + 1):
        batch.step(actions)
        rows, ended = batch.packed.copy(), np.zeros(envs, bool)
        for e in range(envs):
            now = unpack(jnp.asarray(rows[e]))
            _, reward, terminated = task.reward(memory, now, actions[e])
            before = seen[e]
            memory, seen[e] = task.observe(memory, now, jnp.zeros(0))
            ended[e] = terminated | now.truncated
            led = Transition(before, actions[e], reward, seen[e], terminated, now.truncated)
            state = update(observe(shared_with(e, state), led))
            own[e], action = act(state, seen[e], numbers[tick, e])
            state, actions[e] = own[e], action
        batch.reset(np.flatnonzero(ended))
        for e in np.flatnonzero(ended).tolist():
            memory, seen[e] = task.observe(memory, unpack(jnp.asarray(batch.packed[e].copy())), jnp.zeros(0))
            own[e], action = act(restart(shared_with(e, state)), seen[e], numbers[tick, e])
            state, actions[e] = own[e], action

    found = stepper.state["cycle"]
    np.testing.assert_allclose(found.agent.policy.weights[0], state.policy.weights, rtol=2e-3)
    assert found.agent.policy.weights.any()
    np.testing.assert_allclose(found.memory.mean.mean[0], memory.mean.mean, rtol=1e-5)
    np.testing.assert_array_equal(found.memory.mean.count[0], memory.mean.count)
    for e in range(envs):
        np.testing.assert_allclose(found.agent.estimator.trace.weights[0, e], own[e].estimator.trace.weights, rtol=2e-3)
    np.testing.assert_array_equal(stepper.batch.packed[:, :2], batch.packed[:, :2])


@pytest.mark.ci
def test_one_environment_is_the_learner_as_it_was(task, agent):
    steppers = [engine(task, agent), engine(task, agent, envs=1)]
    for stepper in steppers:
        stepper.advance(100)
    same(steppers[0].state, steppers[1].state)


@pytest.mark.ci
def test_the_number_of_workers_changes_no_number(task, agent):
    steppers = [engine(task, agent, envs=2, workers=workers) for workers in (0, 1, 3)]
    for stepper in steppers:
        stepper.advance(120)
    records = [stepper.harvest() for stepper in steppers]
    states = [stepper.state for stepper in steppers]
    for index in (1, 2):
        same((states[0], records[0]), (states[index], records[index]))
    assert records[0]["solved_count"].tolist() == [120, 120]
    steppers[0].restore(states[2])
    for stepper in steppers[::2]:
        stepper.advance(50)
    same(steppers[0].state, steppers[2].state)


@pytest.mark.parametrize("kind", ["plain", pytest.param("natural", marks=pytest.mark.ci)])
def test_a_restored_state_goes_on_bit_for_bit(kind, task, agent):
    learner = agent if kind == "natural" else mg.agent_for(task, PLAIN)
    first, again = (engine(task, learner, envs=2) for _ in range(2))
    first.advance(70)
    kept = first.state
    first.advance(100)
    again.restore(kept)
    again.advance(100)
    same(first.state, again.state)
    assert kept["cycle"].observation.shape == (2, 2, 2)


@pytest.mark.ci
def test_bodies_are_stepped_in_one_batch():
    task = mg.make("hopper")
    agent = natural(task, batch=10)
    stepper = engine(task, agent, threads=1, envs=3)
    stepper.advance(60)
    state = stepper.state["cycle"]
    assert stepper.batch.packed.shape[0] == 6
    assert state.agent.policy.weights.shape[0] == 2
    assert state.agent.policy.weights.any()
    assert len({tuple(row) for row in state.observation[0].tolist()}) == 3  # each environment acts for itself


@pytest.mark.ci
def test_a_run_is_saved_resumed_and_evaluated(drift, task, agent, tmp_path):
    words = f"train gymnasium --task.env-id {drift} --agent.update-every 20 --envs 4 --steps 400 --seeds 2".split()
    assert main([*words, "--out", str(tmp_path / "whole")]) == 0
    learner = mg.agent_for(task, update_every=20, steps=400)  # with the schedules of the whole
    mg.train(task, learner, 200, 2, tmp_path / "parts", window=4, envs=4, progress=False)
    mg.resume(tmp_path / "parts", 400, progress=False)
    whole, parts = mg.load(tmp_path / "whole"), mg.load(tmp_path / "parts")
    same(whole.policies, parts.policies)
    np.testing.assert_array_equal(whole.curve("return")[1], parts.curve("return")[1])
    assert whole.memory.mean.mean.shape == (2, 2)
    assert np.isfinite(mg.evaluate(whole, 60).metrics["return"]).all()
    with pytest.raises(RunDirectoryError, match=r"run\.envs was 4 and is now 2"):
        mg.train(task, learner, 400, 2, tmp_path / "whole", envs=2, progress=False)


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("gymnasium", {"envs": 0}, "envs = 0: must be from 1 to"),
        ("gymnasium", {"envs": 16, "steps": 1000}, "steps = 1000: must be a multiple of envs = 16, .* such as 1008"),
        ("gymnasium", {"envs": 4, "window": 6}, "window = 6: must be a multiple of envs = 4"),
        ("gymnasium", {"workers": -1}, "workers = -1: must be 0"),
        ("hopper", {"workers": 2}, "workers = 2: must be 0 for the task 'hopper'"),
        ("three-state", {"envs": 2}, "envs = 2: must be 1 for the task 'three-state', whose world is compiled"),
    ],
)
def test_what_cannot_be_is_refused_before_any_work(name, settings, message):
    with pytest.raises(ValueError, match=message):
        mg.train(name, **{"steps": 1200, **settings})


@pytest.mark.ci
def test_an_error_in_a_worker_is_raised_here_and_an_end_is_named_and_none_outlives_its_batch(drift):
    stepper = engine(from_gymnasium(drift, fails_at=150), workers=1)
    with pytest.raises(LookupError, match="no more steps") as error:
        stepper.advance(400)
    assert re.match(r"in step \d+ of Drift-v0 of seed 3", error.value.__notes__[0])
    stepper = engine(from_gymnasium(drift, ends_process_at=150), workers=2)
    with pytest.raises(RuntimeError, match="a worker process ended during step with status 7"):
        stepper.advance(400)
    processes = [worker.process for worker in stepper.batch._workers]
    stepper.batch._close()
    assert all(process.poll() is not None for process in processes)


@pytest.mark.slow
def test_workers_end_with_a_process_that_is_killed():
    code = (
        "import motorgrad as mg\n"
        "batch = mg.tasks.from_gymnasium('CartPole-v1').batch([0, 1], workers=2)\n"
        "print(*(worker.process.pid for worker in batch._workers), flush=True)\n"
        "import os, signal; os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    end = time.monotonic() + 300
    while any(alive(int(pid)) for pid in done.stdout.split()):
        assert time.monotonic() < end
        time.sleep(0.1)
