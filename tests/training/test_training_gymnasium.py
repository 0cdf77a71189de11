"""Learning in Gymnasium environments: the engine on the host, runs that stop and go on, and what is learned."""

import gc
import itertools
import json
import signal
import subprocess
import sys
import time

import gymnasium
import jax
import numpy as np
import pytest
from gymnasium import spaces
from training_examples import PLAIN, assert_differ, assert_same, assert_same_run, checkpoints, final_state, learner

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.learning import SGD, Agent, Estimator, Exponential, olgarb
from motorgrad.tasks import from_gymnasium
from motorgrad.training import HostStepper, RunDirectoryError, RunWarning, clear_programs, stepper_for

SEEDS = [3, 11]


class Counted(gymnasium.Env):
    """Shows how long the episode has lasted; each step pays 1; it ends at `end` and is cut at `cut`."""

    observation_space = spaces.Box(-1, 100, (1,))
    action_space = spaces.MultiBinary(1)

    def __init__(self, end=None, cut=None, bad=None):
        self.end, self.cut, self.bad, self.time, self.steps = end, cut, bad, 0, 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.time = 0
        return np.float32([0]), {}

    def step(self, action):
        self.time, self.steps = self.time + 1, self.steps + 1
        seen = np.float32([np.nan if self.steps == self.bad else self.time])
        return seen, 1.0, self.time == self.end, self.time == self.cut, {}


class Closing(Counted):
    closed = 0

    def close(self):
        Closing.closed += 1


class Forgetful(Counted):
    """What it holds of C's cannot be written as data."""

    def __init__(self):
        super().__init__(cut=30)
        self.count = itertools.count()


@pytest.fixture
def register():
    before = set(gymnasium.registry)

    def one(make):
        name = f"Engine{len(gymnasium.registry)}-v0"
        gymnasium.register(id=name, entry_point=make, disable_env_checker=True)
        return name

    yield one
    for name in set(gymnasium.registry) - before:
        del gymnasium.registry[name]


def flags_seen(stepper, decisions, monkeypatch):
    """What `Agent.observe` is handed, decision by decision: next observation, terminated, truncated."""
    seen = []
    observe = Agent.observe

    def watched(self, state, transition):
        flags = (transition.terminated, transition.truncated, transition.diverged)
        jax.debug.callback(lambda *all_of: seen.append([np.asarray(x).item() for x in all_of]),
                           transition.next_observation[0], *flags, ordered=False)  # fmt: skip
        return observe(self, state, transition)

    monkeypatch.setattr(Agent, "observe", watched)
    clear_programs()  # those of an earlier test call the method that it had
    stepper().advance(decisions)
    jax.effects_barrier()
    clear_programs()
    return seen


class Either(Counted):
    """Ends if its seed is 0, and is cut, with times from 10 on, if it is 1."""

    def reset(self, *, seed=None, options=None):
        if seed is not None:
            self.end, self.cut = (3, None) if seed == 0 else (None, 13)
        super().reset(seed=seed)
        self.time = 0 if self.cut is None else 10
        return np.float32([self.time]), {}


def test_the_learner_sees_the_end_before_any_reset_and_what_kind_it_is(register, monkeypatch):
    task = from_gymnasium(register(Either), scaling="none")
    seen = flags_seen(lambda: learner(task, [0, 1], **PLAIN), 6, monkeypatch)
    ended, cut = ([each for each in seen if (each[0] < 10) == first] for first in (True, False))
    assert ended == [[1, False, False, False], [2, False, False, False], [3, True, False, False]] * 2
    assert cut == [[11, False, False, False], [12, False, False, False], [13, False, True, False]] * 2


@pytest.mark.ci
def test_an_end_that_is_also_a_cut_is_an_end(register, monkeypatch):
    task = from_gymnasium(register(lambda: Counted(end=2, cut=2)), scaling="none")
    assert flags_seen(lambda: learner(task, [0]), 2, monkeypatch)[-1] == [2, True, False, False]


@pytest.mark.ci
def test_a_broken_observation_is_a_divergence_and_the_episode_begins_anew(register):
    task = from_gymnasium(register(lambda: Counted(bad=5)), scaling="running")
    stepper = learner(task, SEEDS)
    stepper.advance(12)
    record, state = stepper.harvest(), stepper.state
    np.testing.assert_array_equal(record["diverged"], 1)
    np.testing.assert_array_equal(record["reward"], 11)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(state["cycle"]))
    np.testing.assert_array_equal(state["physics"]["packed"][:, 0], 12 - 5)


@pytest.mark.ci
def test_returns_and_lengths_are_the_environments_own(register):
    task = from_gymnasium(register(lambda: Counted(end=5)), repeat=2, end_reward=-50.0)
    stepper = learner(task, SEEDS)
    stepper.advance(7)  # an episode is three decisions: 2 + 2 + 1 steps
    record = stepper.harvest()
    np.testing.assert_array_equal(record["return"], 5)
    np.testing.assert_array_equal(record["length"], 5)
    np.testing.assert_array_equal(record["return_count"], 2)
    np.testing.assert_array_equal(record["episodes"], 2)
    np.testing.assert_array_equal(record["reward"], 2 * (5 - 50) + 2)


@pytest.mark.ci
def test_the_environments_close_with_their_engine_although_its_program_is_kept(register):
    task = from_gymnasium(register(Closing))
    stepper = learner(task, [0, 1])
    stepper.advance(2)
    Closing.closed = 0  # the one by which the task knows its spaces
    del stepper
    gc.collect()
    assert Closing.closed == 2


@pytest.mark.ci
def test_the_actions_of_the_learner_are_those_of_the_environment():
    """By hand: the same environment, reset and stepped with the actions that the learner chose."""
    task = from_gymnasium("CartPole-v1", scaling="none")
    stepper, alone = learner(task, [5]), gymnasium.make("CartPole-v1")
    seen, _ = alone.reset(seed=5)
    for _ in range(80):
        cycle = stepper.state["cycle"]
        np.testing.assert_array_equal(cycle.observation[0], np.append(seen, np.float32(1)))
        seen, _, terminated, truncated, _ = alone.step(int(cycle.action[0]))
        stepper.advance(1)
        if terminated or truncated:
            seen, _ = alone.reset()


@pytest.mark.ci
def test_the_engine_is_the_hosts_and_another_seed_changes_nothing_of_an_environment():
    task = from_gymnasium("CartPole-v1")
    few, many = (stepper_for(task, Agent(mg.policies.softmax(task), olgarb(0.9), SGD(0.0)), s) for s in ([3], [0, 3]))
    assert type(few) is HostStepper
    for stepper in (few, many):
        stepper.advance(100)
    np.testing.assert_array_equal(few.state["physics"]["packed"][0], many.state["physics"]["packed"][1])


@pytest.mark.ci
def test_a_restored_engine_goes_on_exactly():
    saved, fresh = (learner("gymnasium", SEEDS, **PLAIN) for _ in range(2))
    saved.advance(130)
    state = saved.state
    saved.advance(90)
    assert_differ(saved.state, state)
    fresh.advance(10)
    fresh.restore(state)
    fresh.advance(90)
    assert_same(fresh.state, saved.state)
    for stepper in (fresh, saved):
        stepper.advance(50)
    assert_same(fresh.state, saved.state)


# runs

RUN = {"task": "gymnasium", "steps": 3_000, "seeds": SEEDS, "window": 700}
CHILD = "import json, sys, motorgrad as mg; mg.train(**json.loads(sys.argv[1]), progress=False)"
PATIENCE = 600.0


@pytest.mark.slow
def test_a_killed_run_ends_as_if_it_had_not_been(compiled_environment, tmp_path):
    whole = mg.train(**RUN, out=tmp_path / "whole", progress=False)
    options = json.dumps({**RUN, "out": str(tmp_path / "killed"), "checkpoint_every": 0.02})
    landed = 0
    for share in (0.1, 0.5):
        child = subprocess.Popen([sys.executable, "-c", CHILD, options], env=compiled_environment)
        deadline = time.monotonic() + PATIENCE
        while child.poll() is None and max((int(f.stem) for f in checkpoints(tmp_path / "killed")), default=0) < (
            share * RUN["steps"]
        ):
            assert time.monotonic() < deadline
            time.sleep(0.002)
        child.kill()
        landed += child.wait() == -signal.SIGKILL
    assert landed >= 1
    mg.train(**RUN, out=tmp_path / "killed", progress=False)
    assert_same_run(mg.load(tmp_path / "killed"), mg.load(whole.path))


@pytest.mark.ci
@pytest.mark.parametrize("name", ["InvertedPendulum-v5", "Hopper-v5", "Ant-v5"])
def test_a_run_on_mujoco_goes_on_bit_for_bit(name, tmp_path, monkeypatch):
    task = from_gymnasium(name)
    assert task.no_resume is None
    agent = mg.agent_for(task, policy="bounded-hyperplanes", estimator="olgarb", metric="none", learning_rate=0.01)
    settings = {"agent": agent, "seeds": 2, "window": 50, "progress": False}
    whole = mg.train(task, **settings, steps=240, out=tmp_path / "whole")
    mg.train(task, **settings, steps=130, out=tmp_path / "parts")
    state = final_state(tmp_path / "parts")
    assert all(each.startswith(b"{") for each in state["physics.environments"].tolist())
    monkeypatch.setattr("motorgrad._consent._ALLOWED", set())  # as another process
    assert_same_run(mg.resume(tmp_path / "parts", 240, progress=False), whole)


@pytest.mark.slow
def test_a_run_is_loaded_with_its_task_and_evaluated_with_what_it_had_learned_of_its_senses(tmp_path):
    task = from_gymnasium("CartPole-v1", scaling="running", max_episode_steps=60)
    run = mg.train(task, steps=400, seeds=2, out=tmp_path / "run", progress=False)
    again = mg.load(tmp_path / "run")
    assert again.task == task
    assert_same(again.memory, run.memory)
    counts = run.memory.mean.count
    assert (counts >= 401).all()  # every decision's, and the first of every episode
    judged, again = mg.evaluate(run, 300), mg.evaluate(again, 300)
    assert set(judged.metrics) == {"return", "length"}
    assert_same(judged.metrics, again.metrics)
    assert judged.reward.tolist() == [1, 1]
    stepper = learner(task, run.seeds, mode="sample")
    stepper.set_policies(run.policies, run.memory)
    stepper.advance(100)
    memory = stepper.state["cycle"].memory
    assert memory.frozen.all()
    assert_same((memory.mean, memory.variance), (run.memory.mean, run.memory.variance))
    # The first observation was scaled by them, too.
    fresh = learner(task, run.seeds, mode="sample")
    fresh.set_policies(run.policies, run.memory)
    raw, seen = fresh.state["physics"]["packed"][:, :4], fresh.state["cycle"].observation[:, :4]
    wanted = (raw - run.memory.mean.mean) / np.sqrt(run.memory.variance.mean)
    np.testing.assert_allclose(seen, np.clip(wanted, -5, 5), rtol=1e-3, atol=1e-4)


@pytest.mark.ci
def test_a_run_that_cannot_be_resumed_says_so_first_and_is_refused_unfinished(register, tmp_path):
    name = register(Forgetful)
    task, told = from_gymnasium(name), f"{name}: it cannot be written as data: NoState: env.count is a itertools.count"
    settings = {"seeds": 2, "out": tmp_path, "progress": False}
    with pytest.warns(RunWarning, match=f"cannot be resumed if it is stopped: {told}"):
        run = mg.train(task, steps=50, **settings)
    assert run.complete
    assert mg.load(tmp_path, task).decision == 50
    assert_same(mg.train(task, steps=50, **settings).policies, run.policies)  # given back, without a warning
    before = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.suffix in (".toml", ".state")}
    with pytest.raises(
        RunDirectoryError, match=f"stopped after 50 decisions, which cannot be resumed: {told}.*; choose"
    ):
        mg.train(task, steps=90, **settings)
    assert {file: file.stat().st_mtime_ns for file in before} == before
    mg.train(task, steps=50, seeds=1, progress=False)  # in memory nothing is to be said


@pytest.mark.ci
def test_from_the_command_line(tmp_path, capsys):
    out = str(tmp_path / "run")
    command = ["train", "gymnasium", "--task.env-id", "MountainCar-v0", "--task.kwargs", "max_episode_steps", "40"]
    assert main([*command, "--task.repeat", "4", "--steps", "60", "--seeds", "2", "--out", out]) == 0
    assert "return: median -40 " in capsys.readouterr().out
    run = mg.load(out)
    assert run.task == from_gymnasium("MountainCar-v0", repeat=4, max_episode_steps=40)
    assert main(["evaluate", out, "--steps", "40", "--no-film"]) == 0
    assert main(["train", "gymnasium", "--task.env-id", "CartPol-v1", "--steps", "60", "--out", out]) == 2
    complaint = capsys.readouterr().err
    assert "Did you mean: `CartPole`?" in complaint
    assert "Traceback" not in complaint


@pytest.mark.ci
@pytest.mark.parametrize(
    ("action", "code", "policy"),
    [
        (spaces.Discrete(3, start=-1), "auto", "softmax"),
        (spaces.Discrete(4), "bits", "hyperplanes"),
        (spaces.MultiDiscrete([3, 2]), "auto", "hyperplanes"),
        (spaces.MultiDiscrete([3, 2]), "choice", "softmax"),
        (spaces.MultiBinary(3), "auto", "hyperplanes"),
        (spaces.Box(-1, 1, (2,)), "antagonists", "hyperplanes"),
        (spaces.Box(-3, 1, (2,)), "auto", "bounded-hyperplanes"),
    ],
)
def test_every_kind_of_actions_is_learned_with(register, action, code, policy):
    """What pays is the last of the alternatives, or what is close to the upper bound, in every part of the action."""

    class Paying(Counted):
        action_space = action

        def step(self, chosen):
            assert action.contains(chosen)
            seen, _, terminated, truncated, _ = super().step(chosen)
            return seen, float(np.mean(np.abs(np.ravel(chosen) - best) < 0.5)), terminated, truncated, {}

    best = np.ravel(action.high) if isinstance(action, spaces.Box) else 1
    if isinstance(action, spaces.Discrete | spaces.MultiDiscrete):
        best = np.ravel(action.start) + np.ravel(action.nvec if hasattr(action, "nvec") else action.n) - 1
    task = from_gymnasium(register(lambda: Paying(cut=10)), code=code)
    agent = Agent(mg.policies.initial(policy, task), olgarb(0.0), SGD(0.1))
    run = mg.train(task, agent, steps=1_500, seeds=3, progress=False)
    before, after = (mg.evaluate(run, 300, untrained=untrained).reward for untrained in (True, False))
    assert (before < 0.6).all()
    assert (after > 0.7).all()


# learning


def evaluated(task, agent, steps, seeds, decisions):
    """Frozen returns before and after learning, per seed."""
    run = mg.train(task, agent, steps=steps, seeds=seeds, progress=False)
    return (mg.evaluate(run, decisions, untrained=untrained).metrics["return"] for untrained in (True, False))


@pytest.mark.ci
def test_cart_pole_is_learned_quickly():
    task = from_gymnasium("CartPole-v1", end_reward=-20.0)
    agent = Agent(mg.policies.softmax(task), olgarb(0.95), SGD(0.01))
    before, after = evaluated(task, agent, 8_000, 4, 1_000)
    assert (before < 40).all()
    assert np.median(after) > 3 * np.median(before)
    assert (after > 60).all()


@pytest.mark.slow
def test_cart_pole_is_learned_from_its_own_rewards_alone():
    task = from_gymnasium("CartPole-v1")
    estimator = Estimator(Exponential(0.99), None, update_every=500)
    agent = Agent(mg.policies.softmax(task), estimator, mg.learning.Adam(0.1))
    before, after = evaluated(task, agent, 10_000, 4, 1_000)
    assert np.median(after) > 2 * np.median(before)


SLOW = {
    "mountain-car": {"env_id": "MountainCar-v0", "repeat": 4, "max_episode_steps": 1000, "rate": 0.001, "bar": -170},
    "acrobot": {"env_id": "Acrobot-v1", "repeat": 2, "rate": 5e-4, "bar": -200},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mountain-car", "acrobot"])
def test_a_goal_that_chance_seldom_finds_is_learned(name):
    """The settings of `docs/foreign-environments.md`, for a share of the decisions."""
    settings = dict(SLOW[name])
    rate, bar = settings.pop("rate"), settings.pop("bar")
    task = from_gymnasium(**settings, scaling="running", end_reward=100.0)
    agent = Agent(mg.policies.softmax(task), olgarb(0.95), SGD(rate))
    before, after = evaluated(task, agent, 25_000, 4, 1_500)
    assert (before < 2 * bar).all()
    assert np.median(after) > bar
