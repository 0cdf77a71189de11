"""Options from a file: what drives a command, what overrides what, what is printed, what is refused."""

import os
import re
import tomllib
from pathlib import Path

import pytest
import tomli_w

import motorgrad as mg
from motorgrad.cli import COMMANDS, main
from motorgrad.policies import INITIAL
from motorgrad.schema import PART_CLASSES, descriptions, fields_of
from motorgrad.tasks import TASKS
from motorgrad.training import agent_for

PARTS = {cls: None for kinds in PART_CLASSES.values() for cls in kinds.values()}
PAGE = Path(__file__).parents[2] / "docs" / "configuration.md"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")


def status(*arguments):
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as left:
        return left.code


def checked(capsys, *arguments):
    """What `--check` prints, as a table."""
    capsys.readouterr()
    assert status(*arguments, "--check") == 0
    return tomllib.loads(capsys.readouterr().out)


def write(path, text):
    Path(path).write_text(text)
    return path


def test_a_file_drives_training_and_the_command_line_overrides_it(capsys):
    file = write(
        "a.toml", 'steps = 30\nseeds = [4, 1]\nout = "a"\n[task]\nname = "chain"\nlength = 3\n[agent]\ndecay = 0.5\n'
    )
    assert status("train", "--config", file, "--steps", 40, "--agent.learning-rate", 0.2) == 0
    run = mg.load("a")
    assert run.config["run"] == {"steps": 40, "seeds": [4, 1], "window": 1}
    assert run.task == mg.make("chain", length=3)
    agent = run.config["agent"]
    assert agent["estimator"]["trace"] == {"kind": "exponential", "decay": 0.5}
    assert agent["optimizer"]["learning_rate"] == 0.2
    assert agent["policy"] == {"kind": "softmax"}  # the task's own


def test_what_a_file_leaves_out_is_as_the_task_has_it(capsys):
    file = write("a.toml", "[agent]\nlearning_rate = 0.25\n[task]\nbody = {load_mass = 3}\n")
    found = checked(capsys, "train", "hopper", "--config", file)
    assert found["agent"]["optimizer"]["learning_rate"] == 0.25
    assert (found["agent"]["estimator"]["trace"]["decay"], found["steps"]) == (0.995, 100_000)
    assert (found["task"]["body"]["load_mass"], found["task"]["body"]["link_mass"]) == (3.0, 0.15)


def test_an_option_puts_a_setting_back_to_none(capsys):
    file = write("a.toml", '[task]\nname = "chain"\ntime_limit = 9\n[agent]\ndiscount = 0.9\n')
    found = checked(capsys, "train", "--config", file, "--agent.discount", "None")
    assert found["agent"]["estimator"]["discount"] == "none"
    assert found["task"]["time_limit"] == 9


@pytest.mark.ci  # what is evaluated is named in a file in test_cli_commands, too
@pytest.mark.parametrize("command", ["evaluate", "plot"])
def test_what_must_be_named_may_stand_in_the_file(command, capsys):
    assert status("train", "chain", "--steps", 20, "--out", "x") == 0
    key = {"evaluate": 'run = "x"\nsteps = 30\n', "plot": 'runs = ["x"]\nquantity = ["baseline"]\n'}[command]
    assert status(command, "--config", write("a.toml", key + 'json = "found.json"\n')) == 0
    assert Path("found.json").exists()
    for arguments in ((), ("--config", write("b.toml", ""))):
        capsys.readouterr()
        assert status(command, *arguments) == 2
        assert "run" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_takes_a_file_and_says_so(command, capsys):
    arguments = (command, "chain") if command in ("train", "sim") else (command,)
    assert status(*arguments, "--help") == 0
    said = capsys.readouterr().out
    assert "--config" in said
    assert "--check" in said
    assert status(*arguments, "--config", write("a.toml", "unheard_of = 1\n")) == 2
    assert f"a.toml: unknown setting of {command} 'unheard_of'" in capsys.readouterr().err


def test_a_check_does_nothing(tmp_path, capsys):
    assert checked(capsys, "demo", "--out", "d", "--seeds", 3)["seeds"] == 3
    assert checked(capsys, "train", "chain", "--out", "d", "--json", "deep/r.json")["task"]["name"] == "chain"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.ci
@pytest.mark.representatives("chain", "composed", "gymnasium")
@pytest.mark.parametrize("name", TASKS)
def test_what_a_check_prints_is_a_file_that_says_the_same(name, capsys):
    found = checked(capsys, "train", name, "--seeds", 3, "--agent.decay", 0.25)
    assert found["agent"]["estimator"]["trace"]["decay"] == 0.25
    assert checked(capsys, "train", "--config", write("again.toml", tomli_w.dumps(found))) == found


def test_a_runs_configuration_is_a_file_that_makes_it_again(capsys):
    made = ("train", "chain", "--steps", 60, "--agent.decay", 0.3, "--task.length", 3, "--window", 20, "--out", "a")
    assert status(*made) == 0
    assert status("train", "--config", "a/config.toml", "--out", "b") == 0
    a, b, clocks = mg.load("a"), mg.load("b"), ["wall_time", "cpu_time"]
    assert a.config == b.config
    assert a.metrics.drop_columns(clocks).equals(b.metrics.drop_columns(clocks))
    found = checked(capsys, "train", "--config", "a/config.toml", "--seeds", 32)
    assert (found["seeds"], found["agent"]["estimator"]["trace"]["decay"], found["window"]) == (32, 0.3, 20)


def test_a_run_goes_on_from_its_directory_alone(capsys):
    assert status("train", "chain", "--steps", 60, "--agent.decay", 0.3, "--window", 20, "--out", "a") == 0
    assert status("train", "--resume", "a") == 0  # finished: it is given back
    assert status("train", "--resume", "a", "--steps", 100) == 0
    run = mg.load("a")
    assert (run.decision, run.config["agent"]["estimator"]["trace"]["decay"]) == (100, 0.3)
    capsys.readouterr()
    assert status("train", "--resume", "a", "--agent.decay", 0.4) == 2
    assert "agent.estimator.trace.decay was 0.3 and is now 0.4" in capsys.readouterr().err


@pytest.mark.ci
def test_a_default_learner_is_that_of_the_task_as_asked_for(capsys):
    for name, policy in (("Pendulum-v1", "bounded-hyperplanes"), ("Acrobot-v1", "softmax")):
        found = checked(capsys, "train", "gymnasium", "--task.env-id", name)
        assert found["agent"]["policy"]["kind"] == policy


@pytest.mark.parametrize("how", ["--agent.policy growing", "--agent.policy=growing", "--config a.toml"])
def test_a_tasks_settings_of_its_own_policy_go_with_no_other(how, capsys):
    write("a.toml", "[agent]\npolicy = 'growing'")
    own, other = checked(capsys, "train", "particle"), checked(capsys, "train", "particle", *how.split())
    assert own["agent"]["policy"] == {"kind": "tiles", "copies": 2}
    assert other["agent"]["policy"] == {"kind": "growing"}
    assert other["agent"]["growth"]["criterion"]["kind"] == "clock"  # a policy that grows needs a schedule


def test_the_initial_policys_settings(capsys):
    wanted = {"kind": "gaussians", "width": 0.16, "low": -2.0}
    settings = ("--agent.policy", "gaussians", "--agent.policy.width", 0.16, "--agent.policy.low", -2.0)
    assert checked(capsys, "train", "hopper", *settings)["agent"]["policy"] == wanted
    agent = agent_for("hopper", policy=wanted)
    import jax
    import numpy as np

    np.testing.assert_allclose(np.exp(agent.init(jax.random.key(0)).policy.log_width), 0.16, rtol=1e-6)


REFUSED = [
    ("train chain", "stps = 5", "a.toml: unknown setting of train 'stps': did you mean 'steps'?"),
    ("train chain", "checkpoint-every = 5", "did you mean 'checkpoint_every'?"),
    ("train chain", "steps = 0", "a.toml: steps = 0: must be an integer of at least 1"),
    ("train chain", 'steps = "many"', "a.toml: steps = 'many': must be an integer"),
    ("train chain", "seeds = 1000.5", "a.toml: seeds = 1000.5: must be an integer or a list"),
    ("train chain", "seeds = 1000000000000", "seeds = 1000000000000: must be from 1 to 1000000"),
    ("train chain", "seeds = [1, 1]", "seeds = [1, 1]: must be all different"),
    ("train chain", "seeds = [1, 2]\nfirst_seed = 3", "first_seed = 3"),
    ("train chain", "threads = 1000000", "threads = 1000000"),
    ("train t-maze", "evaluate_episodes = 50", "evaluate_episodes = 50: must be given with evaluate_every"),
    ("train t-maze", 'keep_best = "return"', "keep_best = 'return': must be given with evaluate_every"),
    ("train t-maze", "evaluate_every = 10\nkeep_least = true", "keep_least = True: must be given with keep_best"),
    ("train chain", "config = 'b.toml'", "unknown setting of train 'config'"),
    ("train chain", "resume = 'x'", "resume = 'x': must be an option of the command line"),
    ("train", "[run]\nsteps = 3\n[task]\n", "task.name = None: must be given"),
    ("train", "steps = 3\n[run]\nsteps = 3\n", "steps = 3: must be given once"),
    ("train", "task = 'hopper'", "[task] name ="),
    ("train", "[task]\nname = 'hoper'", "unknown task 'hoper': did you mean 'hopper'"),
    ("train", "[task]\nname = ['hopper']", "unknown task ['hopper']"),
    (
        "train hopper",
        "[task]\nname = 'chain'\nlength = 5",
        "a.toml: task: has settings of 'chain' (length), but the command names 'hopper'",
    ),
    ("train chain", "[task]\nlenght = 5", "a.toml: unknown setting of task 'lenght': did you mean 'length'?"),
    ("train chain", "[task]\nlength = 1", "a.toml: task.length = 1: must be an integer from 2 to 2,000"),
    ("train chain", "[task]\nlength = 100000000", "task.length = 100000000"),
    ("train chain", "[task]\nvariant = 'rest'", "unknown task.variant 'rest': did you mean 'reset'"),
    ("train hopper", "[task.body]\nload_mas = 5", "unknown setting of task.body 'load_mas': did you mean 'load_mass'"),
    ("train hopper", "[task.body]\nload_mass = -5", "task.body.load_mass = -5.0"),
    ("train hopper", "[task]\npenalty = nan", "task.penalty = nan: must be a finite number"),
    ("train hopper", "[task]\naction_period = 1e9", "task.action_period = 1000000000.0"),
    ("train hopper", "[agent]\nunits = 10000000000", "units = 10000000000: must be an integer from 1 to "),
    ("train hopper", "[agent]\nunits = 7", "policy Hyperplanes: outputs = 7"),
    ("train hopper", "[agent]\nupdate_every = 'episod'", "must be an integer or 'episode' or 'never'"),
    ("train hopper", "[agent]\nupdate_every = 3000000000", "update_every = 3000000000"),
    ("train hopper", "[agent]\npolicy = {widht = 1}", "unknown setting of agent.policy 'widht'"),
    (
        "train hopper",
        "[agent]\npolicy = {kind = 'gaussians', widht = 1}",
        "unknown setting of agent.policy 'widht': did you mean 'width'?",
    ),
    (
        "train hopper",
        "[agent]\npolicy = {kind = 'gaussians', width = 'wide'}",
        "agent.policy.width = 'wide': must be a finite number",
    ),
    ("train hopper", "[agent.policy]\nkind = 'gaussians'\nwidth = -1", "agent.policy.width = -1.0"),
    ("train particle", "[agent]\npolicy = {width = 0}", "agent.policy.width = 0.0: must be a finite number above 0"),
    ("train particle", "[task]\nunits = 0", "task.units = 0: must be an integer from 1 to 10,000"),
    ("train particle", "[agent]\ndecay = 1.5", "agent.estimator.trace.decay = 1.5: must be in [0, 1]"),
    ("train particle", "[task]\nregions = [[1, 2, 0.5, 0.1, 0.1]]", "regions[0] centre = (2.0, 0.5): must be within"),
    ("train particle", "[task]\nregions = [[1, 0.5, 0.5, 0, 0.1]]", "regions[0] widths = (0.0, 0.1): must be positive"),
    (
        "train particle",
        "[task]\nunits = 4\n[agent]\npolicy = 'growing'\ngrowth.units = 9",
        "growth.units = 9: must be at most the pool's, 4",
    ),
    ("train particle", "[agent]\npolicy = 'growing'\ngrowth = 'none'", "agent.growth = None: must be set"),
    (
        "train particle",
        "[agent]\npolicy = 'growing'\ngrowth.width = -1",
        "agent.growth.width = -1.0: must be a finite number above 0",
    ),
    ("train hopper", "[agent.policy]\nkind = 'x'", "unknown agent.policy 'x'"),
    ("train hopper", "[agent.policy]\nkind = 'given'", "agent.policy was made in Python"),
    ("train hopper", "agent = 3", "agent = 3: must be a table of changes"),
    ("train hopper", "[agent]\ndecai = 0.5", "unknown setting of agent 'decai': did you mean 'decay'?"),
    ("train hopper", "[agent]\nmetric = 'fischer'", "unknown agent.metric 'fischer': did you mean 'fisher'?"),
    ("train hopper", "[agent]\ndecay = 0.5\nestimator.trace.decay = 0.6", "given once"),
    ("train hopper", "out = ''", "out = '': must be a path"),
    ("demo", "seconds = 1e30", "seconds = 1e+30"),
    ("evaluate", "run = 3", "run = 3: must be a path"),
    ("list", "steps", "a.toml: not TOML"),
]


@pytest.mark.parametrize(("command", "text", "named"), REFUSED, ids=[f"{c}: {t!r}" for c, t, _ in REFUSED])
def test_what_a_file_says_wrong_is_refused_by_name(command, text, named, capsys):
    assert status(*command.split(), "--config", write("a.toml", text)) == 2
    said = capsys.readouterr().err
    assert named in said
    assert "a.toml" in said
    assert said.count("\n") == 1
    assert os.listdir() == ["a.toml"]


def test_an_error_tells_what_the_file_says_from_what_overrides_it(capsys):
    assert status("train", "chain", "--config", write("a.toml", "steps = 5"), "--steps", 0) == 2
    assert "a.toml with --steps 0: steps = 0" in capsys.readouterr().err


UNWRITABLE = [
    *[([*command.split(), "--json", "file/r.json"], "json") for command in ("list", "demo", "train chain", "bench")],
    (["train", "chain", "--out", "file/run"], "out"),
    (["demo", "--out", "file"], "out"),
    (["evaluate", "x", "--json", "."], "json"),
    (["evaluate", "x", "--steps", 5, "--video", "file/a.mp4"], "video"),
    (["evaluate", "x", "--steps", 5, "--video", "a.gif"], "video"),
]


@pytest.mark.parametrize(("arguments", "name"), UNWRITABLE, ids=[" ".join(map(str, a)) for a, _ in UNWRITABLE])
def test_what_cannot_be_written_is_refused_before_the_work(arguments, name, capsys, monkeypatch):
    write("file", "")
    if arguments[0] == "evaluate":
        mg.train("hopper", steps=3, out="x", progress=False)
    before = sorted(Path().rglob("*"))
    capsys.readouterr()
    assert status(*arguments) == 2
    said = capsys.readouterr()
    assert re.search(rf"{name} = '.*': (cannot be written|must be a path that ends in)", said.err)
    assert said.out == ""
    assert sorted(Path().rglob("*")) == before


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_refused(tmp_path, capsys):
    (tmp_path / "shut").mkdir(mode=0o500)
    assert status("list", "--json", "shut/x.json") == 2
    assert "is not writable" in capsys.readouterr().err


# ---- help


@pytest.mark.parametrize("cls", [*TASKS.values(), mg.bodies.Hopper, *PARTS], ids=lambda cls: cls.__name__)
def test_every_setting_is_explained(cls):
    fields = set(fields_of(cls))
    helps = descriptions(cls)
    assert fields <= set(helps)
    assert all(len(helps[name]) > 10 for name in fields)


@pytest.mark.parametrize("kind", INITIAL)
def test_every_setting_of_an_initial_policy_is_explained(kind):
    helps = descriptions(INITIAL[kind])
    assert [name for name in fields_of(INITIAL[kind]) if len(helps.get(name, "")) <= 10] == []


def test_help_shows_the_text_of_a_setting_its_choices_and_its_default(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")  # one column of boxes
    assert status("train", "hopper", "--help-all") == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "Cost of an active muscle per decision. (default: 0.1, at least 0)" in said
    assert "Mass of the load on the slide. (default: 2 kg" in said
    assert "{" + ",".join(INITIAL) + "}" in said.replace(", ", ",")  # a long list goes on on the next line
    assert "{symmetric,spring}" in said
    assert "**" not in said


# ---- the page


def test_the_pages_files_are_in_order(capsys):
    text = PAGE.read_text(encoding="utf-8")
    files = re.findall(r"^```toml\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    assert files
    for content in files:
        found = checked(capsys, "train", "--config", write("page.toml", content))
        assert found["task"]["name"] in ("hopper", "composed")


def test_the_pages_errors_are_what_is_said(capsys):
    text = PAGE.read_text(encoding="utf-8")
    pairs = re.findall(r"^\| `([^`]*)` \| `([^`]*)` \|$", text, re.MULTILINE)
    assert len(pairs) >= 4
    for line, said in pairs:
        content = line if line.startswith("[") else f"{line}\n[task]"
        content = content.replace("] ", "]\n")
        assert status("train", "hopper", "--config", write("hop.toml", content)) == 2
        assert said in capsys.readouterr().err


def test_a_key_of_another_command_is_refused(tmp_path, capsys):
    file = tmp_path / "sim.toml"
    file.write_text('[task]\nname = "hopper"\n[steps]\na = 1\n')
    assert main(["sim", "--config", str(file), "--check"]) == 2
    assert "unknown setting of sim 'steps'" in capsys.readouterr().err
