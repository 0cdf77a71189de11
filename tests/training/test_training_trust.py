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
import tomli_w
from gymnasium import spaces
from training_examples import NEVER, PLAIN, change_facts, checkpoints

import motorgrad as mg
from motorgrad import _consent
from motorgrad._processes import IMPORTED
from motorgrad.cli import main
from motorgrad.tasks import from_gymnasium
from motorgrad.training import NotTrusted
from motorgrad.training.store import _checkpoint as store

MODULE = """
import gymnasium, pathlib
pathlib.Path(__file__).with_suffix(".imported").touch()
gymnasium.register("Rolling-v0", "gymnasium.envs.classic_control.cartpole:CartPoleEnv", max_episode_steps=50)
"""
RUN = {"agent": PLAIN, "steps": 60, "seeds": 2, "window": 20, "checkpoint_every": NEVER, "progress": False}


NUMBERS = itertools.count()  # what one test has trusted is allowed in this process


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
    name = f"stranger_{next(NUMBERS)}_{os.getpid()}"
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
    told = rf"imports '{strange}:Rolling-v0' \(from '.*{strange}.py'\), which can do anything; nothing was imported"
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
        assert f"imports '{strange}:Rolling-v0' (from " in said, command
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
    ("settings", "names"),
    [
        ({"env_id": "CartPole-v1"}, []),
        ({"env_id": "evil:X-v0"}, ["evil:X-v0"]),
        ({"env_id": "os:system"}, ["os:system"]),  # that a module is loaded is no consent
        ({"env_id": "os:CartPole-v1"}, []),  # it is, and the name is registered, so that nothing is imported
        ({"env_id": "X-v0", "kwargs": {"inner": "evil:Y-v0", "file": "C:/x.xml", "n": 3}}, ["evil:Y-v0", "C:/x.xml"]),
        ({"env_id": 7, "kwargs": [1]}, []),
    ],
)
def test_what_a_task_would_import_is_read_from_its_settings(settings, names):
    assert mg.tasks.TASKS["gymnasium"].imports(settings) == names


NO_IDS = [
    "mod:/x",
    "mod:\\x",
    "mod:",
    "a b:x-v0",
    " mod:x-v0",
    "mod:x:y",
    ":x-v0",
    "1mod:x",
    "mod.:x",
    "m\u00f6d:x",
    "mod:x\n",
]


@pytest.mark.parametrize("env_id", NO_IDS)
def test_what_is_no_id_is_no_id_for_anyone(env_id):
    """There is one reader of ids: what it does not take for one is not tried elsewhere."""
    for make in (lambda: from_gymnasium(env_id), lambda: mg.make("gymnasium", env_id=env_id)):
        with pytest.raises(ValueError, match=r"env_id = .*: must be an id such as"):
            make()


RUNNING = ["os:system", "subprocess:run", "builtins:exec", "os:path.exists", "motorgrad:train", "gymnasium:make"]


@pytest.mark.parametrize("env_id", RUNNING)
def test_a_loaded_module_is_not_asked_less(env_id, tmp_path, capsys):
    task = f'[task]\nname = "gymnasium"\nenv_id = "{env_id}"\nkwargs = {{ command = "touch {tmp_path}/run" }}\n'
    (tmp_path / "c.toml").write_text(task)
    (tmp_path / "task.toml").write_text(task.replace("[task]\n", ""))
    file = ["--config", str(tmp_path / "c.toml")]
    (tmp_path / "study.toml").write_text(f"steps = 100\nseeds = 1\n{task}")
    study = ["sweep", str(tmp_path / "study.toml"), "--check"]
    for command in (["train", *file, "--check"], ["train", *file], study, ["sim", *file]):
        assert main([*command]) == 2, command
        assert env_id in capsys.readouterr().err, command
    with pytest.raises(NotTrusted, match=f"imports '{env_id}', which can do anything"):
        mg.tasks.load(tmp_path / "task.toml")
    with pytest.raises(NotTrusted, match=env_id):
        mg.make("gymnasium", env_id="GymV26Environment-v0", kwargs={"env_id": env_id})
    assert not (tmp_path / "run").exists()


def test_a_question_shows_no_escape_sequences(tmp_path, capsys):
    bad = "\\u001b[2Jmod:x-v0"
    (tmp_path / "c.toml").write_text(f'[task]\nname = "gymnasium"\nkwargs = {{ inner = "{bad}" }}\n')
    assert main(["train", "--config", str(tmp_path / "c.toml"), "--check"]) == 2
    said = capsys.readouterr().err
    assert "\x1b" not in said
    assert r"\x1b[2Jmod:x-v0" in said


def test_ones_own_run_is_not_asked_for_and_anothers_checksum_or_signature_does_not_help(strange, tmp_path):
    task = from_gymnasium(f"{strange}:Rolling-v0")
    mg.train(task, **RUN, out=tmp_path / "mine")
    _consent._ALLOWED.clear()
    gymnasium.registry.pop("Rolling-v0")
    del sys.modules[strange]  # as another process of the same user
    assert mg.load(tmp_path / "mine").task == task
    _consent._ALLOWED.clear()
    gymnasium.registry.pop("Rolling-v0")
    mark = tmp_path / "mine" / ".signature"
    mark.write_text(mark.read_text()[::-1])
    for run in ("mine", "run"):  # the other was signed with another task
        with pytest.raises(NotTrusted):
            _ = mg.load(tmp_path / run).task


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
    assert f"imports '{strange}:Rolling-v0'".encode() in said
    assert bool(imported(tmp_path)) == (status == 0)


def at_a_terminal(answers, monkeypatch, *command):
    """The status of a command at a terminal where somebody has typed `answers` ahead, and what it showed."""
    ours, theirs = pty.openpty()
    with open(os.dup(theirs)) as stdin, open(theirs, "w") as stderr, monkeypatch.context() as patched:
        patched.setattr(sys, "stdin", stdin)
        patched.setattr(sys, "stderr", stderr)
        os.write(ours, answers)
        status = main([*map(str, command)])
        print("the end", end="", file=stderr, flush=True)
        shown = b""
        while b"the end" not in shown:  # not at its end: the terminal may echo what was typed ahead later than that
            shown += os.read(ours, 10_000)
    os.close(ours)
    return status, shown.decode()


def of_environments(file, *env_ids, **kwargs):
    """The file of a study of environments."""
    tasks = [{"name": "gymnasium", "env_id": env_id, "kwargs": kwargs} for env_id in env_ids]
    file.write_text(tomli_w.dumps({"steps": 10, "task": tasks}))
    return file


def test_a_yes_is_for_what_the_question_showed_alone(tmp_path, monkeypatch):
    """As it was for all: a study could show a name that everybody trusts, and import another."""
    study = of_environments(tmp_path / "s.toml", "trusted:Reach-v3", "os:system", command=f"touch {tmp_path}/ran")
    status, shown = at_a_terminal(b"y\nn\n", monkeypatch, "sweep", study, "--check")
    assert status == 2
    assert shown.count("Run it? [y/N]") == 2
    assert shown.index("imports 'trusted:Reach-v3' (") < shown.index("imports 'os:system' (")
    assert not _consent.is_allowed("os:system")
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("names", [["os:" + "x" * 120], [f"os:x{n}" for n in range(11)]], ids=["long", "many"])
def test_no_question_is_asked_that_does_not_show_all(names, tmp_path, monkeypatch):
    """A long name could hide what it ends in, and many names those that scroll away."""
    study = of_environments(tmp_path / "s.toml", "CartPole-v1", **{f"of{n}": name for n, name in enumerate(names)})
    status, shown = at_a_terminal(b"y\n", monkeypatch, "sweep", study, "--check")
    assert status == 2
    assert "--trust on the command line" in shown
    assert "Run it?" not in shown
    assert len(shown) < 3000


@pytest.mark.parametrize("words", [["os:system"], ["--out", "os:system"], ["--out=os:system"]])
def test_a_path_names_no_code(words, tmp_path, monkeypatch):
    """As a stranger's folder did that was called like a function."""
    monkeypatch.chdir(tmp_path)
    os.mkdir("os:system")
    of_environments(tmp_path / "os:system" / "study.toml", "os:system", command="touch ran")
    assert main(["sweep", *words, "--check"]) == 2
    assert not _consent.is_allowed("os:system")
    assert not (tmp_path / "ran").exists()


# ---- states of environments


@pytest.fixture
def held():
    gymnasium.register(id="Held-v0", entry_point=Held, disable_env_checker=True)
    yield from_gymnasium("Held-v0")
    del gymnasium.registry["Held-v0"]


def test_an_environment_whose_state_is_no_data_cannot_be_resumed_and_says_so(held, tmp_path):
    assert "it cannot be written as data" in held.no_resume
    with pytest.warns(mg.training.RunWarning, match=r"Held-v0: it cannot be written as data: NoState: .*count is a"):
        mg.train(held, **RUN, out=tmp_path)
    (checkpoint,) = checkpoints(tmp_path)
    assert store.load(checkpoint)[0]["physics.environments"].tolist() == [b"", b""]


class Evil:
    def __reduce__(self):
        return os.mkdir, ("evil_was_run",)


def with_environments(run, content):
    """Write another state of its environments into a run, with right checksums, as a stranger can."""
    (checkpoint,) = checkpoints(run)
    arrays, facts = store.load(checkpoint)
    arrays["physics.environments"] = np.array([content] * 2, np.bytes_)
    store.save(checkpoint, arrays, {name: fact for name, fact in facts.items() if name not in ("format", "names")})


@pytest.mark.parametrize("protocol", [0, pickle.HIGHEST_PROTOCOL])
def test_a_pickle_in_a_run_is_never_run_trusted_or_not(protocol, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = tmp_path / "run"
    mg.train(from_gymnasium("CartPole-v1"), **RUN, out=run)
    with_environments(run, pickle.dumps(Evil(), protocol))
    for trust in (False, True):
        with pytest.raises(ValueError, match="the state does not fit the environment"):
            mg.resume(run, 90, trust=trust, progress=False)
    assert main(["train", "--resume", str(run), "--steps", "90", "--trust"]) == 2
    assert "the state does not fit" in capsys.readouterr().err
    mg.load(run)
    mg.resume(run, progress=False)  # it is finished
    assert not (tmp_path / "evil_was_run").exists()
