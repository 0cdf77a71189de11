"""Processes that are killed, interrupted or in each other's way. What is lost is made again, bit for bit."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from training_examples import assert_same_run, checkpoints, final_state

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.training import RunDirectoryError

RUNS = {
    # the windows fit no block of random numbers, and are longer than the slices of work between two checkpoints
    "three-state": {"task": "three-state", "steps": 1_000_000, "seeds": [0, 1, 2], "window": 199_999, "threads": 1},
    "hopper": {"task": "hopper", "steps": 3_000, "seeds": [0, 1, 2], "window": 1_499, "threads": 1},
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
EVERY = 0.05  # seconds between checkpoints
PATIENCE = 120.0  # seconds
CHILD = """
import json, sys, motorgrad as mg
given, learner = map(json.loads, sys.argv[1:])
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

    def start(name, out, every=EVERY, **changes):
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
    """Kill the run so often at random instants, further on every time, then let it finish."""
    landed = 0
    for share in np.sort(random.uniform(0.0, 0.7, kills)):
        child = begin(name, path)
        wait_until(lambda share=share: reached(path) > share * RUNS[name]["steps"], child)
        time.sleep(random.uniform(0.0, 0.1))
        child.kill()
        landed += child.wait() == -signal.SIGKILL
    assert landed >= 1  # or the machine is so quick that the runs must be longer
    child = begin(name, path)
    assert child.wait(PATIENCE) == 0


@pytest.mark.representatives("three-state-2")
@pytest.mark.parametrize(
    ("name", "kills"),
    [
        ("three-state", 2),
        ("hopper", 2),
        pytest.param("three-state", 8, marks=pytest.mark.slow),
        pytest.param("hopper", 8, marks=pytest.mark.slow),
        pytest.param("natural", 8, marks=pytest.mark.slow),
        pytest.param("networks", 3, marks=pytest.mark.slow),
    ],
)
def test_a_run_killed_at_random_instants_ends_as_if_it_had_not_been(name, kills, undisturbed, begin, tmp_path):
    kill_and_resume(name, tmp_path, begin, kills, np.random.default_rng(kills))
    assert_same_run(mg.load(tmp_path), undisturbed(name))


@pytest.mark.representatives(".lock")
@pytest.mark.parametrize("appears", [".lock", "checkpoint/initial.policies"])
def test_a_run_killed_before_its_first_checkpoint_begins_again(appears, begin, tmp_path):
    short = {"steps": 200}
    child = begin("hopper", tmp_path / "killed", every=1e9, **short)
    wait_until((tmp_path / "killed" / appears).exists, child)
    child.kill()
    assert child.wait() == -signal.SIGKILL
    assert not checkpoints(tmp_path / "killed")
    if (tmp_path / "killed" / "config.toml").exists():
        with pytest.raises(RunDirectoryError, match="has no whole checkpoint yet"):
            mg.load(tmp_path / "killed")
    killed, whole = (train("hopper", tmp_path / name, **short) for name in ("killed", "whole"))
    assert_same_run(killed, whole)


@pytest.mark.slow
def test_a_run_killed_at_any_instant_of_its_beginning_begins_again(undisturbed, begin, tmp_path):
    random = np.random.default_rng(3)
    for delay in random.uniform(0.3, 4.0, 10):
        child = begin("hopper", tmp_path)
        time.sleep(delay)
        child.kill()
        child.wait()
    assert begin("hopper", tmp_path).wait(PATIENCE) == 0
    assert_same_run(mg.load(tmp_path), undisturbed("hopper"))


@pytest.mark.parametrize("name", ["three-state", pytest.param("hopper", marks=pytest.mark.slow)])
def test_ctrl_c_saves_everything_and_the_same_command_goes_on(name, undisturbed, compiled_environment, tmp_path):
    run = RUNS[name]
    options = {"steps": run["steps"], "window": run["window"], "seeds": 3, "out": tmp_path, "checkpoint-every": 1e9}
    command = [part for option, value in options.items() for part in (f"--{option}", str(value))]
    child = subprocess.Popen(
        [sys.executable, "-m", "motorgrad", "train", name, "--threads", "1", *command],
        env=compiled_environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert f"{name}: " in child.stderr.readline()  # the first tenth is done
        assert not checkpoints(tmp_path)
        child.send_signal(signal.SIGINT)
        said, complaints = child.communicate(timeout=PATIENCE)
    finally:
        child.kill()
        child.wait()
    assert child.returncode == 130
    assert "Traceback" not in complaints
    assert "the same command continues this run" in said
    stopped = mg.load(tmp_path)
    assert not stopped.complete
    assert stopped.decision >= run["steps"] // 10
    assert stopped.metrics.num_rows == 3 * (stopped.decision // run["window"])
    assert_same_run(train(name, tmp_path), undisturbed(name))


def test_a_directory_in_use_is_refused_and_can_be_read(begin, tmp_path, capsys):
    child = begin("three-state", tmp_path, every=0.0)
    wait_until(lambda: reached(tmp_path) > 1, child)
    child.send_signal(signal.SIGSTOP)  # it holds the directory however long this takes
    with pytest.raises(RunDirectoryError, match=rf"in use by another process \(process {child.pid}\)"):
        train("three-state", tmp_path)
    assert main(["train", "three-state", "--out", str(tmp_path)]) == 2
    assert f"in use by another process (process {child.pid})" in capsys.readouterr().err
    assert mg.load(tmp_path).decision == reached(tmp_path) > 0
    child.kill()
    child.wait()
    # a dead process holds nothing; but what it was to make is more than is asked for now
    with pytest.raises(RunDirectoryError, match=r"of which [\d,]+ are made, but steps = 1:"):
        train("three-state", tmp_path, steps=1)
    assert reached(tmp_path) == final_state(tmp_path)["decision"] > 1
