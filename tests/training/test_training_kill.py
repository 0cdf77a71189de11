"""Processes that are killed, interrupted or in each other's way. What is lost is made again, bit for bit."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from training_examples import NEVER, assert_same_run, checkpoints, final_state

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.training import RunDirectoryError

RUNS = {
    # the windows fit no block of random numbers, and are a fifth of the steps, as `held` needs
    "three-state": {"task": "three-state", "steps": 1_000_000, "seeds": [0, 1, 2], "window": 199_999, "threads": 1},
    "hopper": {"task": "hopper", "steps": 3_000, "seeds": [0, 1, 2], "window": 599, "threads": 1},
    "natural": {"task": "linear-recruitment", "steps": 400_000, "seeds": [0, 1, 2], "window": 79_999},
    "networks": {"task": "chain", "steps": 40_000, "seeds": [0, 1, 2], "window": 1_999},
}
LEARNERS = {
    "networks": {
        "policy": {"kind": "softmax", "network": {"hidden": [16, 16]}},
        "baseline": {"kind": "network-critic", "discount": 0.9, "network": {"hidden": [16]}},
        "estimator.bound": {"kind": "overshooting", "scaling": 3.0},
        "learning_rate": 1.0,
    },
    "natural": {
        "metric": {"kind": "fisher", "rate": 3e-4},
        "damping": {"threshold": 0.05, "gain": 1e-6},
        "baseline": {"kind": "binned", "rate": 0.02},
        "normalization": "root-mean-square",
    },
}
PATIENCE = 600.0  # seconds
LATEST = 0.7  # of the steps, when a run is to be killed
# It saves after every slice of work, and no slice is longer than a window. Near its end it waits to be killed, so that
# it cannot be over before, however late a busy machine lets the test have its turn.
CHILD = """
import json, sys, time, motorgrad as mg
from motorgrad.training.store import RunDirectory
given, learner = map(json.loads, sys.argv[1:])
save = RunDirectory.save
def held(directory, state, about, *records):
    while about["decision"] > 0.9 * given["steps"]:
        time.sleep(1)
    save(directory, state, about, *records)
RunDirectory.save = held
mg.train(agent=learner, **given, progress=False)
"""


def train(name, out, **changes):
    return mg.train(agent=LEARNERS.get(name, {}), **{**RUNS[name], **changes}, out=out, progress=False)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Each run made in one go in this process, once, when first asked for."""
    made = {}

    def of(name):
        if name not in made:
            made[name] = train(name, tmp_path_factory.mktemp(name))
        return made[name]

    return of


@pytest.fixture
def begin(compiled_environment):
    """Begin a run in a process of its own; whatever is left of it goes with the test."""
    children = []

    def start(name, out, every=0.0, **changes):
        options = json.dumps({**RUNS[name], "out": str(out), "checkpoint_every": every, **changes})
        learner = json.dumps(LEARNERS.get(name, {}))
        children.append(subprocess.Popen([sys.executable, "-c", CHILD, options, learner], env=compiled_environment))
        return children[-1]

    yield start
    for child in children:
        child.kill()
        child.wait()


def wait_until(ready, child):
    """Until `ready()`, or the child is over."""
    deadline = time.monotonic() + PATIENCE
    while not ready() and child.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.002)


def reached(path):
    """The decision of the newest checkpoint."""
    return max((int(file.stem) for file in checkpoints(path)), default=0)


def kill_and_resume(name, path, begin, kills, random):
    """Kill the run so often at random instants, further on every time, then let it finish in this process."""
    for share in np.sort(random.uniform(0.0, LATEST, kills)):
        child = begin(name, path)
        wait_until(lambda share=share: reached(path) > share * RUNS[name]["steps"], child)
        time.sleep(random.uniform(0.0, 0.1))
        child.kill()
        assert child.wait() == -signal.SIGKILL
    assert not mg.load(path).complete
    train(name, path)


@pytest.mark.slow  # killed once: test_a_directory_in_use_...
@pytest.mark.parametrize(
    ("name", "kills"),
    [
        pytest.param("three-state", 2, marks=pytest.mark.ci),
        pytest.param("hopper", 2, marks=pytest.mark.ci),
        ("three-state", 8),
        ("hopper", 8),
        ("natural", 8),
        ("networks", 3),
    ],
)
def test_a_run_killed_at_random_instants_ends_as_if_it_had_not_been(name, kills, undisturbed, begin, tmp_path):
    kill_and_resume(name, tmp_path, begin, kills, np.random.default_rng(kills))
    assert_same_run(mg.load(tmp_path), undisturbed(name))


@pytest.mark.ci
@pytest.mark.parametrize("appears", [".lock", "checkpoint/initial.policies"])
@pytest.mark.parametrize("name", ["three-state", "hopper"])
def test_a_run_killed_before_its_first_checkpoint_begins_again(name, appears, begin, tmp_path):
    short = {"steps": 200}
    child = begin(name, tmp_path / "killed", every=NEVER, **short)
    wait_until((tmp_path / "killed" / appears).exists, child)
    child.kill()
    assert child.wait() == -signal.SIGKILL
    assert not checkpoints(tmp_path / "killed")
    if (tmp_path / "killed" / "config.toml").exists():
        with pytest.raises(RunDirectoryError, match="has no whole checkpoint yet"):
            mg.load(tmp_path / "killed")
    killed, whole = (train(name, tmp_path / path, **short) for path in ("killed", "whole"))
    assert_same_run(killed, whole)


@pytest.mark.slow
def test_a_run_killed_at_any_instant_of_its_beginning_begins_again(undisturbed, begin, tmp_path):
    random = np.random.default_rng(3)
    for delay in random.uniform(0.3, 4.0, 10):
        child = begin("hopper", tmp_path)
        time.sleep(delay)
        child.kill()
        child.wait()
    train("hopper", tmp_path)
    assert_same_run(mg.load(tmp_path), undisturbed("hopper"))


# Imported by a command, it sends its process a signal after a tenth of the decisions, as a user does who sees them.
INTERRUPTED = """
import os
from motorgrad.training import BodyStepper, WorldStepper
def interrupted(advance):
    def call(stepper, decisions):
        advance(stepper, decisions)
        if stepper.decision >= {least}:
            os.kill(os.getpid(), {number})
    return call
for kind in (BodyStepper, WorldStepper):
    kind.advance = interrupted(kind.advance)
"""


@pytest.mark.ci  # in this process: test_training_config.py
@pytest.mark.parametrize("name", ["three-state", "hopper"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["Ctrl-C", "SIGTERM"])
def test_a_polite_end_saves_everything_and_the_same_command_goes_on(
    number, name, undisturbed, compiled_environment, tmp_path
):
    run, out = RUNS[name], tmp_path / "run"
    (tmp_path / "interrupted.py").write_text(INTERRUPTED.format(least=run["steps"] // 10, number=int(number)))
    options = {"steps": run["steps"], "window": run["window"], "seeds": 3, "out": out, "checkpoint-every": NEVER}
    command = [part for option, value in options.items() for part in (f"--{option}", str(value))]
    path = os.pathsep.join([str(tmp_path), compiled_environment.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "motorgrad", "--import", "interrupted", "train", name, "--threads", "1", *command],
        env={**compiled_environment, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 130, done.stderr
    assert f"{name}: " in done.stderr  # how far it is, in a line
    assert "Traceback" not in done.stderr
    assert "the same command continues this run" in done.stdout
    stopped = mg.load(out)
    assert not stopped.complete
    assert stopped.decision == reached(out) >= run["steps"] // 10
    assert stopped.metrics.num_rows == 3 * (stopped.decision // run["window"])
    assert_same_run(train(name, out), undisturbed(name))


def test_a_directory_in_use_is_refused_can_be_read_and_goes_on_once_its_process_was_killed(
    begin, undisturbed, tmp_path, capsys
):
    child, random = begin("three-state", tmp_path), np.random.default_rng(1)
    share = random.uniform(0.0, LATEST)
    wait_until(lambda: reached(tmp_path) > 1 + share * RUNS["three-state"]["steps"], child)
    time.sleep(random.uniform(0.0, 0.1))
    child.send_signal(signal.SIGSTOP)  # it holds the directory however long this takes
    with pytest.raises(RunDirectoryError, match=rf"in use by another process \(process {child.pid}\)"):
        train("three-state", tmp_path)
    assert main(["train", "three-state", "--out", str(tmp_path)]) == 2
    assert f"in use by another process (process {child.pid})" in capsys.readouterr().err
    assert mg.load(tmp_path).decision == reached(tmp_path) > 0
    child.kill()
    assert child.wait() == -signal.SIGKILL
    # a dead process holds nothing; but what it was to make is more than is asked for now
    with pytest.raises(RunDirectoryError, match=r"of which [\d,]+ are made, but steps = 1:"):
        train("three-state", tmp_path, steps=1)
    assert reached(tmp_path) == final_state(tmp_path)["decision"] > 1
    assert_same_run(train("three-state", tmp_path), undisturbed("three-state"))
