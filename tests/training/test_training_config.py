"""What a run keeps of its configuration; going on from the directory alone; where and by what a run was made."""

import json
import signal
import subprocess
import sys
import time
import tomllib

import numpy as np
import optax
import pytest
import tomli_w
from training_examples import TASK_NAMES, assert_same_run, checkpoints

import motorgrad as mg
from motorgrad._settings import build, table
from motorgrad.tasks import TASKS
from motorgrad.training import AgentSettings, RunDirectoryError, RunWarning, settings_for

FINITE = "three-state"


def small(task=FINITE, agent=None, steps=60, out=None, **options):
    options = {"seeds": [4, 1], "window": 20, "threads": 1, "progress": False} | options
    return mg.train(task, agent, steps, out=out, **options)


@pytest.mark.representatives("hopper", "linear-recruitment")
@pytest.mark.parametrize("name", TASK_NAMES)
def test_a_run_made_from_settings_keeps_them_and_nothing_twice(name, tmp_path):
    task = TASKS[name]()
    settings = settings_for(task, decay=0.25)
    run = small(task, settings, steps=4, window=2, out=tmp_path)
    kept = tomllib.loads((tmp_path / "config.toml").read_text())
    assert kept == run.config
    assert kept["agent"] == table(settings)
    assert build(AgentSettings, kept["agent"]) == settings


@pytest.mark.representatives("three-state")
@pytest.mark.parametrize("name", [FINITE, "hopper"])
def test_a_run_goes_on_from_its_directory_alone(name, tmp_path):
    task = mg.make(name)
    settings = settings_for(task, decay=0.25, rate=0.02)
    small(task, settings, steps=50, out=tmp_path / "parts")
    for steps in (None, 130):
        mg.resume(tmp_path / "parts", steps, threads=1, progress=False)
    small(task, settings, steps=130, out=tmp_path / "whole")
    assert_same_run(mg.load(tmp_path / "parts"), mg.load(tmp_path / "whole"))


def test_an_agent_made_by_hand_must_be_given_to_go_on(tmp_path):
    task = mg.make(FINITE)
    agent = settings_for(task).agent(task)
    run = small(agent=agent, out=tmp_path)
    assert run.config["agent"]["estimator"]["trace"] == {"kind": "Exponential", "decay": 0.8}
    with pytest.raises(RunDirectoryError, match="made in Python, not from settings: give the agent"):
        mg.resume(tmp_path)
    assert small(agent=agent, steps=80, out=tmp_path).decision == 80


def test_the_same_learner_made_in_another_way_goes_on(tmp_path):
    task = mg.make(FINITE)
    small(out=tmp_path)
    by_hand = small(agent=settings_for(task).agent(task), steps=80, out=tmp_path)
    assert by_hand.config["agent"] == table(settings_for(task))  # they are not forgotten
    otherwise = settings_for(task, estimator="olpomdp", baseline="mean")
    assert small(agent=otherwise, steps=100, out=tmp_path).decision == 100


def test_a_task_of_ones_own_must_be_given_to_go_on(tmp_path, monkeypatch):
    small(out=tmp_path)
    monkeypatch.delitem(TASKS, FINITE)
    with pytest.raises(RunDirectoryError, match="'three-state' is not in the registry"):
        mg.resume(tmp_path)


def as_before(path):
    """Make a run's directory one of the first format: the learner's structure stood in the configuration."""
    from motorgrad.training._checkpoint import into, load, save

    file = path / "checkpoint" / "initial.policies"
    arrays, about = load(file)
    config = tomllib.loads((path / "config.toml").read_text())
    (path / "config.toml").write_text(tomli_w.dumps({**config, "agent": about["learner"]}))
    template = mg.load(path).initial
    save(file, into(template, arrays), {"decision": 0})


def test_a_directory_of_the_first_format_is_loaded_and_goes_on(tmp_path):
    run = small(out=tmp_path)
    as_before(tmp_path)
    again = mg.load(tmp_path)
    assert again.config["agent"]["estimator"]["trace"]["decay"] == 0.8
    np.testing.assert_array_equal(again.policies.weights, run.policies.weights)
    np.testing.assert_array_equal(again.initial.weights, run.initial.weights)
    assert small(steps=80, out=tmp_path).decision == 80
    assert mg.resume(tmp_path, 100, progress=False).decision == 100  # now the settings are known


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("x = ", "not TOML"),
        ("a = 1", "must be run, task and agent"),
        ("[run]\nsteps = 'many'\nseeds = [1]\nwindow = 1\n[task]\n[agent]\n", "run.steps = 'many'"),
        ("[run]\nsteps = 1\nseeds = [1]\nwindow = 1\n[task]\n[agent]\n", "a table with name"),
        ("[run]\nsteps = 1\nseeds = [1]\nwindow = 1\n[task]\nname = 'chain'\n[agent]\n", "a table with policy"),
    ],
)
def test_a_spoilt_configuration_is_refused_by_name(content, named, tmp_path):
    small(out=tmp_path)
    (tmp_path / "config.toml").write_text(content)
    for call in (mg.load, mg.resume):
        with pytest.raises((RunDirectoryError, ValueError), match=named) as refused:
            call(tmp_path)
        assert "config.toml" in str(refused.value)


def test_a_change_of_the_settings_by_hand_is_noticed(tmp_path):
    small(out=tmp_path)
    file = tmp_path / "config.toml"
    file.write_text(file.read_text().replace("decay = 0.8", "decay = 0.7"))
    with pytest.raises(RunDirectoryError, match=r"agent.estimator.trace.decay was 0.8 and is now 0.7"):
        mg.resume(tmp_path)


RULES = {
    "rate": lambda x: optax.sgd(x),
    "first decay": lambda x: optax.adam(0.01, b1=x),
    "second decay": lambda x: optax.adam(0.01, b2=x),
    "weight decay": lambda x: optax.adamw(0.01, weight_decay=x),
    "clipping": lambda x: optax.chain(optax.clip_by_global_norm(x), optax.sgd(0.01)),
}


@pytest.mark.representatives("rate", "weight decay")
@pytest.mark.parametrize("kind", RULES)
def test_the_constants_of_an_optax_rule_are_compared(kind, tmp_path):
    start = mg.policies.softmax(mg.make(FINITE))
    for value, steps in ((0.5, 60), (0.5, 80)):
        small(agent=mg.Agent(start, ascent=RULES[kind](value)), steps=steps, out=tmp_path)
    with pytest.raises(RunDirectoryError, match=r"agent\.ascent\.steps was"):
        small(agent=mg.Agent(start, ascent=RULES[kind](0.6)), steps=100, out=tmp_path)


# ---- provenance


def altered(path, **changes):
    """Pretend that a run's last session had other versions, or another processor."""
    file = path / "provenance.json"
    told = json.loads(file.read_text())
    last = told["sessions"][-1]
    for name, value in changes.items():
        (last if name in last else last["versions"])[name] = value
    file.write_text(json.dumps(told))


@pytest.mark.representatives("changes0")
@pytest.mark.parametrize("changes", [{"jax": "0.0.1"}, {"processor": "an abacus"}, {"mujoco": "3.0", "numpy": "1.0"}])
def test_going_on_under_other_conditions_is_said(changes, tmp_path):
    small(out=tmp_path)
    altered(tmp_path, **changes)
    with pytest.warns(RunWarning, match="goes on, but not bit for bit: ") as said:
        small(steps=80, out=tmp_path)
    for name, value in changes.items():
        assert f"{name} was {value} and is now " in str(said[0].message)
    small(steps=100, out=tmp_path)  # said once


def test_a_finished_run_is_given_back_without_a_word(tmp_path):
    small(out=tmp_path)
    altered(tmp_path, jax="0.0.1")
    assert small(out=tmp_path).complete


# ---- being asked to stop


@pytest.mark.representatives("15")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_polite_end_saves_everything(number, process_environment, tmp_path):
    command = ["train", "hopper", "--steps", "4000000000", "--out", str(tmp_path / "x"), "--checkpoint-every", "1e9"]
    child = subprocess.Popen(
        [sys.executable, "-m", "motorgrad", *command, "--window", "1000000000", "--threads", "1"],
        env=process_environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        deadline = time.monotonic() + 120
        while not (tmp_path / "x" / "provenance.json").exists():
            assert time.monotonic() < deadline
            assert child.poll() is None
            time.sleep(0.05)
        time.sleep(1.0)
        child.send_signal(number)
        said, complaints = child.communicate(timeout=120)
    finally:
        child.kill()
        child.wait()
    assert child.returncode == 130, complaints
    assert "Traceback" not in complaints
    assert "the same command goes on where it stopped" in said
    stopped = mg.load(tmp_path / "x")
    assert 0 < stopped.decision == int(checkpoints(tmp_path / "x")[-1].stem)


def test_a_second_request_interrupts_at_once():
    from motorgrad._signals import stop_when_asked

    before = signal.getsignal(signal.SIGTERM)
    with stop_when_asked() as stopped:
        assert not stopped()
        signal.raise_signal(signal.SIGTERM)
        assert stopped()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGTERM) == before
