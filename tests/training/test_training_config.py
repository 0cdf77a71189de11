"""What a run keeps of its configuration; going on from the directory alone; where and by what a run was made."""

import shutil
import signal
import tomllib

import optax
import pytest
from training_examples import NEVER, TASK_NAMES, assert_same, assert_same_run, checkpoints

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.tasks import TASKS
from motorgrad.training import RunDirectoryError, RunWarning, WorldStepper, agent_for, agent_from_table, agent_table
from motorgrad.training.store import _directory

FINITE = "three-state"


def small(task=FINITE, agent=None, steps=60, out=None, **options):
    options = {"seeds": [4, 1], "window": 20, "threads": 1, "checkpoint_every": NEVER, "progress": False} | options
    return mg.train(task, agent, steps, out=out, **options)


@pytest.fixture(scope="module")
def finite(tmp_path_factory):
    """The directory of a run. Copy it before changing anything there."""
    return small(out=tmp_path_factory.mktemp(FINITE)).path


@pytest.mark.ci
@pytest.mark.representatives("three-state")
@pytest.mark.parametrize("name", TASK_NAMES)
def test_a_run_made_from_settings_keeps_them_and_nothing_twice(name, tmp_path):
    task = TASKS[name]()
    agent = agent_for(task, decay=0.25)
    run = small(task, agent, steps=4, window=2, out=tmp_path)
    kept = tomllib.loads((tmp_path / "config.toml").read_text())
    assert kept == run.config
    assert kept["agent"] == agent_table(agent)
    assert agent_from_table(task, kept["agent"]) == agent


@pytest.mark.representatives("three-state")
@pytest.mark.parametrize("name", [FINITE, "hopper"])
def test_a_run_goes_on_from_its_directory_alone(name, tmp_path):
    task = mg.make(name)
    changes = {"decay": 0.25, "learning_rate": 0.02}
    small(task, changes, steps=50, out=tmp_path / "parts")
    for steps in (None, 130):
        mg.resume(tmp_path / "parts", steps, threads=1, progress=False)
    small(task, changes, steps=130, out=tmp_path / "whole")
    assert_same_run(mg.load(tmp_path / "parts"), mg.load(tmp_path / "whole"))


def test_an_agent_made_by_hand_must_be_given_to_go_on(tmp_path):
    agent = mg.Agent(mg.policies.softmax(mg.make(FINITE)), mg.learning.olgarb(0.8), mg.learning.SGD(0.01))
    run = small(agent=agent, out=tmp_path)
    assert run.config["agent"]["estimator"]["trace"] == {"kind": "exponential", "decay": 0.8}
    with pytest.raises(RunDirectoryError, match="was made in Python and is not registered: give the agent again"):
        mg.resume(tmp_path)
    assert small(agent=agent, steps=80, out=tmp_path).decision == 80


def test_the_same_learner_made_in_another_way_goes_on(tmp_path):
    task = mg.make(FINITE)
    small(out=tmp_path)
    policy = agent_for(task).policy
    by_hand = mg.Agent(policy, mg.learning.olgarb(0.8), mg.learning.SGD(0.01))
    assert small(agent=by_hand, steps=80, out=tmp_path).config["agent"] == agent_table(agent_for(task))
    otherwise = agent_for(task, estimator="olpomdp", baseline="mean")
    assert small(agent=otherwise, steps=100, out=tmp_path).decision == 100


def test_a_task_of_ones_own_must_be_given_to_go_on(tmp_path, monkeypatch):
    small(out=tmp_path)
    monkeypatch.delitem(TASKS, FINITE)
    with pytest.raises(RunDirectoryError, match="'three-state' is not in the registry"):
        mg.resume(tmp_path)


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
def test_a_spoilt_configuration_is_named_and_the_checkpoints_used(finite, content, named, tmp_path):
    shutil.copytree(finite, tmp_path, dirs_exist_ok=True)
    (tmp_path / "config.toml").write_text(content)
    with pytest.warns(
        RunWarning, match=rf"config\.toml: .*{named}.*; using the configuration in the newest checkpoint"
    ):
        assert mg.load(tmp_path).config == mg.load(finite).config
    with pytest.warns(RunWarning, match=named):
        assert mg.resume(tmp_path, progress=False).complete
    assert (tmp_path / "config.toml").read_bytes() == (finite / "config.toml").read_bytes()
    for file in checkpoints(tmp_path):
        file.unlink()
    (tmp_path / "config.toml").write_text(content)
    for call in (mg.load, mg.resume):
        with pytest.raises(RunDirectoryError, match=rf"config\.toml: .*{named}"):
            call(tmp_path)


def test_a_change_of_the_settings_by_hand_is_noticed(tmp_path):
    small(out=tmp_path)
    file = tmp_path / "config.toml"
    file.write_text(file.read_text().replace("decay = 0.8", "decay = 0.7"))
    with pytest.raises(RunDirectoryError, match=r"config.toml: agent.estimator.trace.decay is 0.7, and was 0.8 when"):
        mg.resume(tmp_path)


RULES = {
    "rate": lambda x: optax.sgd(x),
    "first decay": lambda x: optax.adam(0.01, b1=x),
    "second decay": lambda x: optax.adam(0.01, b2=x),
    "weight decay": lambda x: optax.adamw(0.01, weight_decay=x),
    "clipping": lambda x: optax.chain(optax.clip_by_global_norm(x), optax.sgd(0.01)),
}


@pytest.mark.ci  # of a rule in parts: test_training_runs.py
@pytest.mark.parametrize("kind", RULES)
def test_the_constants_of_an_optax_rule_are_compared(kind, tmp_path):
    start = mg.policies.softmax(mg.make(FINITE))
    for value, steps in ((0.5, 60), (0.5, 80)):
        small(agent=mg.Agent(start, optimizer=RULES[kind](value)), steps=steps, out=tmp_path)
    with pytest.raises(RunDirectoryError, match=r"agent\.optimizer\.steps was"):
        small(agent=mg.Agent(start, optimizer=RULES[kind](0.6)), steps=100, out=tmp_path)


# ---- provenance


@pytest.fixture
def pretend(monkeypatch):
    """Pretend to have other versions, or another processor."""
    provenance = _directory.provenance

    def to_have(**changes):
        told = provenance()
        for name, value in changes.items():
            (told if name in told else told["versions"])[name] = value
        monkeypatch.setattr(_directory, "provenance", lambda: told)
        monkeypatch.setattr(_directory, "versions", lambda: told["versions"])

    return to_have


@pytest.mark.representatives("changes0")
@pytest.mark.parametrize("changes", [{"jax": "0.0.1"}, {"processor": "an abacus"}, {"mujoco": "3.0", "numpy": "1.0"}])
def test_going_on_under_other_conditions_is_said(changes, pretend, tmp_path):
    pretend(**changes)
    small(out=tmp_path)
    pretend()
    with pytest.warns(RunWarning, match="continues, but not bit for bit: ") as said:
        small(steps=80, out=tmp_path)
    for name, value in changes.items():
        assert f"{name} was {value} and is now " in str(said[0].message)
    small(steps=100, out=tmp_path)  # said once


def test_a_finished_run_is_given_back_without_a_word(pretend, tmp_path):
    pretend(jax="0.0.1")
    small(out=tmp_path)
    pretend()
    assert small(out=tmp_path).complete


# ---- being asked to stop


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.ci)])
def test_a_polite_end_saves_everything_and_the_same_command_goes_on(number, tmp_path, monkeypatch, capsys):
    command = ["train", FINITE, "--steps", "40000", "--seeds", "2", "--window", "1000", "--checkpoint-every", "1e9"]
    advance, out = WorldStepper.advance, tmp_path / "x"

    def interrupted(stepper, decisions):
        advance(stepper, decisions)
        if 0 < stepper.decision < 1000:
            signal.raise_signal(number)

    with monkeypatch.context() as patch:
        patch.setattr(WorldStepper, "advance", interrupted)
        assert main([*command, "--out", str(out)]) == 130
    said = capsys.readouterr()
    assert "Traceback" not in said.err
    assert "the same command continues this run" in said.out
    stopped = mg.load(out)
    assert not stopped.complete
    assert 0 < stopped.decision == int(checkpoints(out)[-1].stem) < 1000
    assert main([*command, "--out", str(out)]) == 0
    assert_same(mg.load(out).policies, mg.train(FINITE, None, 40_000, 2, window=1000, progress=False).policies)


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
