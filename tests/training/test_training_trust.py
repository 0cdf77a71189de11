"""Nothing that a run directory or a settings file names is imported or unpickled before its user says so."""

import itertools
import os
import pickle
import pty
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from training_examples import NEVER, PLAIN, assert_same, change_facts, checkpoints

import motorgrad as mg
from motorgrad._commands import IMPORTED
from motorgrad.cli import main
from motorgrad.tasks import from_gymnasium
from motorgrad.tasks.gymnasium._batch import called_by
from motorgrad.training import NotTrusted
from motorgrad.training.store import _checkpoint as store

MODULE = """
import gymnasium, pathlib
pathlib.Path(__file__).with_suffix(".imported").touch()
gymnasium.register("Rolling-v0", "gymnasium.envs.classic_control.cartpole:CartPoleEnv", max_episode_steps=50)
"""
RUN = {"agent": PLAIN, "steps": 60, "seeds": 2, "window": 20, "checkpoint_every": NEVER, "progress": False}


class Held(gymnasium.Env):
    """It holds something of C's, so it is pickled."""

    observation_space = spaces.Box(-1, 1000, (1,))
    action_space = spaces.MultiBinary(1)

    def __init__(self):
        self.count = itertools.count()

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.float32([next(self.count)]), {}

    def step(self, action):
        now = next(self.count)
        return np.float32([now]), self.np_random.normal(), now % 10 == 9, False, {}


@pytest.fixture
def strange(tmp_path, monkeypatch):
    """A stranger's run, whose configuration names a module; a fresh one, as it is imported only once."""
    name = f"stranger_{len(sys.modules)}_{os.getpid()}"
    (tmp_path / f"{name}.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    mg.train("gymnasium", **RUN, out=tmp_path / "run")
    config = (tmp_path / "run" / "config.toml").read_text()
    assert 'env_id = "CartPole-v1"' in config
    (tmp_path / "run" / "config.toml").write_text(config.replace("CartPole-v1", f"{name}:Rolling-v0"))
    (checkpoint,) = checkpoints(tmp_path / "run")
    change_facts(checkpoint, lambda facts: facts["config"]["task"].update(env_id=f"{name}:Rolling-v0"))
    yield name
    sys.modules.pop(name, None)
    if name in IMPORTED:  # by --import, for the processes that later commands start
        IMPORTED.remove(name)
    gymnasium.registry.pop("Rolling-v0", None)


def imported(tmp_path):
    return list(tmp_path.glob("*.imported"))


def test_nothing_is_imported_until_it_is_trusted(strange, tmp_path, capsys):
    run = tmp_path / "run"
    told = rf"making its task 'gymnasium' imports {strange} \(from .*{strange}.py\); nothing was imported"
    loaded = mg.load(run)
    assert loaded.policies is not None
    for use in (lambda: loaded.task, lambda: mg.evaluate(run), lambda: mg.resume(run, 80)):
        with pytest.raises(NotTrusted, match=told):
            use()
    config = ["--config", str(run / "config.toml")]
    for command in (
        ["evaluate", str(run)],
        ["train", "--resume", str(run)],
        ["train", "--resume", str(run), "--check"],
        ["train", *config, "--check"],
        ["train", "gymnasium", *config, "--task.env-id", "CartPole-v1", "--check"],
        ["train", *config, "--help"],
        ["sim", "--run", str(run)],
        ["sim", *config, "--check"],
    ):
        assert main(command) == 2, command
        said = capsys.readouterr().err
        assert f"imports {strange} (from " in said, command
        assert "--trust" in said
    assert not imported(tmp_path)
    assert strange not in sys.modules
    assert mg.evaluate(mg.load(run, trust=True), 20).reward.shape == (2,)
    assert imported(tmp_path)


@pytest.mark.parametrize("how", ["--trust", "--task.env-id", "--import"])
def test_a_module_that_the_user_names_or_trusts_is_imported(how, strange, tmp_path, capsys):
    run, name = tmp_path / "run", f"{strange}:Rolling-v0"
    command = {
        "--trust": ["evaluate", str(run), "--steps", "20", "--no-film", "--trust"],
        "--task.env-id": ["train", "gymnasium", "--config", str(run / "config.toml"), "--task.env-id", name, "--check"],
        "--import": ["--import", strange, "evaluate", str(run), "--steps", "20", "--no-film"],
    }[how]
    try:
        status = main(command)
    except SystemExit as ended:
        status = ended.code
    assert status == 0, capsys.readouterr().err
    assert imported(tmp_path)


def test_a_file_cannot_trust_itself(strange, tmp_path, capsys):
    file = tmp_path / "run" / "config.toml"
    for line in ("trust = true\n", "allow_changed = true\n"):
        other = tmp_path / "other.toml"
        other.write_text(line + '[task]\nname = "gymnasium"\nenv_id = "CartPole-v1"\n')
        assert main(["train", "--config", str(other), "--check"]) == 2
        assert "must be an option of the command line" in capsys.readouterr().err
        other.write_text(line + file.read_text())
        assert main(["train", "--config", str(other), "--check"]) == 2
    assert not imported(tmp_path)


@pytest.mark.parametrize(
    ("settings", "modules"),
    [
        ({"env_id": "CartPole-v1"}, []),
        ({"env_id": "evil:X-v0"}, ["evil"]),
        ({"env_id": "  a.b:ns/X-v0"}, ["a.b"]),
        ({"env_id": "X-v0", "kwargs": {"inner": "evil:Y-v0", "file": "C:/x.xml", "n": 3}}, ["evil"]),
        ({"env_id": 7, "kwargs": [1]}, []),
    ],
)
def test_what_a_task_would_import_is_read_from_its_settings(settings, modules):
    assert mg.tasks.TASKS["gymnasium"].imports(settings) == modules


# ---- the question at a terminal

ASKED = """
import sys
from motorgrad.cli import main
sys.exit(main(["evaluate", sys.argv[1], "--steps", "20", "--no-film"]))
"""


@pytest.mark.ci
@pytest.mark.parametrize(("answer", "status"), [("y", 0), ("n", 2), ("", 2)])
def test_at_a_terminal_it_asks(answer, status, strange, tmp_path, compiled_environment):
    ours, theirs = pty.openpty()
    path = os.pathsep.join([str(tmp_path), compiled_environment.get("PYTHONPATH", "")])
    child = subprocess.Popen(
        [sys.executable, "-c", ASKED, str(tmp_path / "run")],
        stdin=theirs,
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env={**compiled_environment, "PYTHONPATH": path},
    )
    os.close(theirs)
    said = b""
    while b"[y/N]" not in said:
        said += os.read(ours, 1000)
    assert not imported(tmp_path)
    os.write(ours, answer.encode() + b"\n")
    assert child.wait(600) == status
    os.close(ours)
    assert f"imports {strange}".encode() in said
    assert bool(imported(tmp_path)) == (status == 0)


# ---- pickles


@pytest.fixture
def held():
    gymnasium.register(id="Held-v0", entry_point=Held, disable_env_checker=True)
    yield from_gymnasium("Held-v0")
    del gymnasium.registry["Held-v0"]


@pytest.mark.ci
def test_an_environment_that_is_only_pickled_goes_on_in_the_same_process(held, tmp_path):
    whole = mg.train(held, **{**RUN, "steps": 90}, out=tmp_path / "whole")
    for steps in (60, 90):
        parts = mg.train(held, **{**RUN, "steps": steps}, out=tmp_path / "parts")
    assert_same(parts.policies, whole.policies)


@pytest.mark.ci
def test_another_process_must_trust_it_and_is_told_what_would_run(held, tmp_path, monkeypatch):
    run = mg.train(held, **RUN, out=tmp_path)
    monkeypatch.setattr(store, "_written", set())  # as another process
    told = r"holds pickled environments: to continue, they are unpickled, which calls .*_make_skeleton_class|.*Held"
    kept = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    for use in (lambda: mg.resume(tmp_path, 90), lambda: mg.train(held, **{**RUN, "steps": 90}, out=tmp_path)):
        with pytest.raises(NotTrusted, match=told):
            use()
    assert {file: file.read_bytes() for file in kept} == kept
    assert_same(mg.resume(tmp_path).policies, run.policies)  # a finished run needs none of it
    assert mg.resume(tmp_path, 90, trust=True, progress=False).decision == 90


class Evil:
    def __reduce__(self):
        return os.mkdir, ("evil_was_run",)


@pytest.mark.parametrize("evaluated", [False, pytest.param(True, marks=pytest.mark.ci)])
def test_an_evil_pickle_is_not_run_and_its_function_is_named(evaluated, tmp_path, capsys):
    task, run, more = from_gymnasium("CartPole-v1"), tmp_path / "run", {**RUN, "steps": 90}
    mg.train(task, **RUN, out=run)
    (checkpoint,) = checkpoints(run)
    arrays, facts = store.load(checkpoint)
    arrays["physics.environments"] = np.array([pickle.dumps(Evil())] * 2, np.bytes_)
    store.save(checkpoint, arrays, {name: fact for name, fact in facts.items() if name not in ("format", "names")})
    store._written.clear()
    for use in (lambda: mg.resume(run, 90), lambda: mg.train(task, **more, out=run)):
        with pytest.raises(NotTrusted, match=r"which calls posix\.mkdir; nothing was run"):
            use()
    assert main(["train", "--resume", str(run), "--steps", "90"]) == 2
    assert "which calls posix.mkdir" in capsys.readouterr().err
    mg.load(run)
    if evaluated:  # which reads the policies alone, as `load` does
        mg.evaluate(run, 5)
    mg.resume(run, progress=False)  # it is finished
    assert not os.path.exists("evil_was_run")


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_what_a_pickle_calls_is_read_from_it(protocol):
    assert called_by(pickle.dumps([Evil(), Evil()], protocol))[-1] in ("posix.mkdir", "os.mkdir")
    assert called_by(b"\x80\x05no pickle")[-1].startswith("bytes that cannot be read")
