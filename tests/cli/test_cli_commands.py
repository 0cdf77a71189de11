"""The commands: what they do, what they leave behind, what they refuse. Some in processes of their own, as a user's."""

import dataclasses
import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from pyarrow import parquet

import motorgrad as mg
from motorgrad.cli import COMMANDS, main
from motorgrad.learning import Estimator
from motorgrad.policies import INITIAL
from motorgrad.tasks import TASKS

SHARED = [
    pytest.param(name, marks=pytest.mark.ci)
    if name in ("chain", "hexapod-synergy", "linear-recruitment", "particle", "three-state")
    else name
    for name in TASKS
]
"""All tasks, some of them for the share."""


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where runs go by default, and where MuJoCo notes divergences
    monkeypatch.setenv("COLUMNS", "200")  # so that no message is broken in two


class Runs(dict):
    """Where a small finished run of each task is, as the command line makes it when it is first asked for."""

    def __init__(self, path):
        self.path = path

    def __missing__(self, name):
        self[name] = out = self.path / name
        options = ["--steps", "120", "--seeds", "2", "--first-seed", "3", "--window", "20"]
        assert main(["train", name, *options, "--out", str(out), "--json", str(out.with_suffix(".json"))]) == 0
        return out


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return Runs(tmp_path_factory.mktemp("runs"))


def status(*arguments):
    """The exit status of a command, however it leaves."""
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as left:
        return left.code


def process(environment, *arguments):
    command = [sys.executable, "-m", "motorgrad", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=1200)


def frames_of(path):
    """Every frame of a film, decoded, its pixels in a row."""
    size, sink = 48 * 32, ["-vf", "scale=48:32", "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), *sink]
    return np.frombuffer(subprocess.run(command, capture_output=True, check=True).stdout, np.uint8).reshape(-1, size)


def read(path):
    return json.loads(Path(path).read_text())


# ---- help


@pytest.mark.parametrize("asked", [[], ["--help"], ["-h"], ["help"]])
def test_help_names_every_command(asked, capsys):
    assert main(asked) == 0
    said = capsys.readouterr().out
    for name, what in COMMANDS.items():
        assert f"{name} " in said
        assert what in said


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name, capsys):
    assert status(name, "--help") == 0
    said = capsys.readouterr().out
    assert f"usage: motorgrad {name}" in said


def test_the_usual_help_fits_a_screen_and_names_the_rest(capsys):
    assert status("train", "hopper", "--help") == 0
    said = capsys.readouterr().out
    assert len(said.splitlines()) <= 50
    assert "--seeds" in said
    assert "--help-all" in said
    assert "--task.reward-type, --agent.kind, --agent.decay" in " ".join(said.split())
    assert "--task.penalty" not in said
    assert "--give-up-after" not in said


@pytest.mark.ci
@pytest.mark.representatives("hopper")
@pytest.mark.parametrize("name", TASKS)
def test_train_explains_the_settings_of_every_task(name, capsys):
    assert status("train", name, "--help-all") == 0
    said = capsys.readouterr().out
    assert "--steps" in said
    assert "--agent.decay" in said
    assert "--agent.estimator.trace.decay" in said
    assert "--task." in said


def test_the_version_is_the_packages(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"motorgrad {mg.__version__}\n"


# ---- list


def test_list_names_all_that_is_registered(tmp_path, capsys):
    assert main(["list", "--json", str(tmp_path / "list.json")]) == 0
    said = capsys.readouterr().out
    found = read(tmp_path / "list.json")
    assert "kinds of initial policy" not in said  # they are the policies
    for kind, registry in (("tasks", TASKS), ("policies", INITIAL), ("estimators", Estimator.presets)):
        assert set(found[kind]) == set(registry)
        for name, what in found[kind].items():
            assert what
            assert f"  {name} " in said


@pytest.fixture
def my_tasks(tmp_path, monkeypatch):
    """A module, `my_tasks`, that registers the task `short-chain`; what it registers is taken back."""
    code = """
        import motorgrad as mg

        class Short(mg.tasks.Chain):
            name = "short-chain"

        mg.tasks.TASKS["short-chain"] = Short
    """
    (tmp_path / "my_tasks.py").write_text(textwrap.dedent(code))
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "my_tasks", raising=False)
    known = dict(TASKS)
    yield
    TASKS.clear()
    TASKS.update(known)


@pytest.mark.usefixtures("my_tasks")
def test_a_module_is_imported_first_and_what_it_registers_is_known(capsys):
    assert main(["--import", "my_tasks", "list"]) == 0
    assert "short-chain" in capsys.readouterr().out
    assert status("--import", "my_tasks", "train", "short-chain", "--check") == 0


@pytest.mark.ci
@pytest.mark.usefixtures("my_tasks")
def test_a_task_of_a_module_is_trained_and_evaluated():
    assert main(["--import", "my_tasks", "train", "short-chain", "--steps", "10", "--out", "run"]) == 0
    assert main(["evaluate", "run", "--steps", "10"]) == 0


def test_what_a_module_would_register_is_refused_without_it(tmp_path, capsys):
    (tmp_path / "agent.toml").write_text('[agent]\nestimator = "mine"\n', encoding="utf-8")
    (tmp_path / "study.toml").write_text('steps = 10\n[task]\nname = "short-chain"\n', encoding="utf-8")
    for arguments in (
        ["train", "short-chain"],
        ["train", "--config", "study.toml"],
        ["sweep", "study.toml"],
        ["train", "chain", "--config", "agent.toml"],
    ):
        assert main([*arguments, "--out", "refused"]) == 2
        assert "as motorgrad --import MODULE COMMAND" in capsys.readouterr().err
    for arguments, said in ((["--import"], "needs the name of a module"), (["--import", "nope", "list"], "No module")):
        assert main(arguments) == 2
        assert said in capsys.readouterr().err


# ---- train


@pytest.mark.representatives("hopper")  # and the chain is, where it is evaluated
@pytest.mark.parametrize("name", SHARED)
def test_train_learns_every_task(name, runs):
    out = runs[name]
    found, run = read(out.with_suffix(".json")), mg.load(out)
    assert (found["task"], found["decisions"], found["complete"], found["path"]) == (name, 120, True, str(out))
    assert run.task == TASKS[name]()
    assert run.seeds == [3, 4]
    # the last tenth of six windows is the last one
    np.testing.assert_allclose(found["reward"]["per_seed"], run.curve("reward")[1][:, -1], rtol=1e-6)
    assert found["reward"]["median"] == pytest.approx(np.median(found["reward"]["per_seed"]))


@pytest.mark.ci
def test_train_takes_the_tasks_and_the_learners_settings(capsys):
    changed = ["--task.length", 4, "--task.variant", "reset", "--agent.decay", 0.3, "--agent.estimator", "olpomdp"]
    assert status("train", "chain", "--steps", 10, "--out", "x", *changed) == 0
    said = capsys.readouterr().out
    assert "done after 10 decisions per seed" in said
    assert "next: motorgrad plot x" in said
    run = mg.load("x")
    assert run.task == mg.make("chain", length=4, variant="reset")
    assert run.config["agent"]["estimator"]["trace"]["decay"] == 0.3
    assert run.config["agent"]["estimator"]["baseline"] == "none"


@pytest.mark.ci
def test_a_run_goes_to_runs_by_default_and_goes_on_there(tmp_path):
    for steps, made in ((20, 20), (40, 40), (30, 40)):
        assert status("train", "three-state", "--steps", steps, "--window", 10) == 0
        assert mg.load(tmp_path / "runs" / "three-state").decision == made


def test_results_for_machines_alone_on_the_standard_output(capsys):
    assert status("train", "three-state", "--steps", 20, "--json", "-") == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["decisions"] == 20
    assert "three-state" in said.err  # progress


# ---- evaluate

LATER = {"chain": (), "hopper": pytest.mark.ci}  # the hopper is evaluated with other settings below


@pytest.mark.parametrize(
    ("name", "mode"),
    [
        *(pytest.param(n, "sample", marks=LATER.get(n, pytest.mark.slow)) for n in TASKS),
        pytest.param("hopper", "mode", marks=pytest.mark.ci),
        pytest.param("chain", "mode", marks=pytest.mark.ci),
    ],
)
def test_evaluate_judges_every_seed(name, mode, runs, capsys):
    assert status("evaluate", runs[name], "--steps", 60, "--mode", mode, "--no-film", "--json", "e.json") == 0
    found = read("e.json")
    assert (found["task"], found["steps"], found["mode"]) == (name, 60, mode)
    assert len(found["reward"]["per_seed"]) == 2
    assert "reward: median" in capsys.readouterr().out
    outcome = mg.evaluate(mg.load(runs[name]), 60, mode=mode)
    assert found["reward"]["per_seed"] == outcome.reward.tolist()


@pytest.mark.ci
def test_evaluate_says_what_the_task_measures_of_the_motion(runs, capsys):
    assert status("evaluate", runs["hexapod-synergy"], "--steps", 160, "--no-film", "--json", "e.json") == 0
    found, said = read("e.json"), capsys.readouterr().out
    kinds = mg.evaluate(mg.load(runs["hexapod-synergy"]), 160).measures["gait"].tolist()
    assert found["gait"] == kinds
    assert len(found["duty"]["per_seed"]) == 2
    for kind in kinds:
        assert f"{kinds.count(kind)} {kind}" in said


def test_evaluate_judges_both_modes_in_turn(runs, capsys):
    assert status("evaluate", runs["chain"], "--steps", 60, "--mode", "both", "--no-film", "--json", "e.json") == 0
    found, said = read("e.json"), capsys.readouterr().out
    assert said.index("sample:\n") < said.index("mode:\n")
    for mode in ("sample", "mode"):
        outcome = mg.evaluate(mg.load(runs["chain"]), 60, mode=mode)
        assert found["modes"][mode]["reward"]["per_seed"] == outcome.reward.tolist()
    assert found["modes"]["sample"] != found["modes"]["mode"]


def test_evaluate_writes_a_table_of_what_happened(runs, capsys):
    run = mg.load(runs["chain"])
    options = ["--steps", 60, "--mode", "both", "--json", "e.json"]
    assert status("evaluate", runs["chain"], *options, "--table", "deep/in/happened.parquet") == 0
    assert "table of 2 episodes, 122 rows: deep/in/happened.parquet" in capsys.readouterr().out
    assert read("e.json")["table"] == "deep/in/happened.parquet"
    table = parquet.read_table("deep/in/happened.parquet")
    for seed, mean in zip(run.seeds, mg.evaluate(run, 60).reward, strict=True):  # that of the first mode
        rewards = table["reward"].to_numpy()[table["seed"].to_numpy() == seed]
        assert np.nansum(rewards) / 60 == pytest.approx(mean, rel=1e-5)
    assert status("evaluate", runs["chain"], "--steps", 60, "--seed", run.seeds[1], "--table", "one.sto") == 0
    assert f"seed={run.seeds[1]}\n" in Path("one.sto").read_text()
    options = ["--steps", 60, "--random-seed", 3, "--table", "other.parquet"]
    assert status("evaluate", runs["chain"], *options) == 0
    other = parquet.read_table("other.parquet")["reward"].to_numpy()[:61]
    assert np.nansum(other) / 60 == pytest.approx(mg.evaluate(run, 60, seed=3).reward[0], rel=1e-5)
    capsys.readouterr()
    for wrong, said in ((["--table", "a.xlsx"], "ends in .parquet, .csv, .sto"), (["--every", "step"], "--table of a")):
        assert main(["evaluate", str(runs["chain"]), *wrong]) == 2
        assert said in capsys.readouterr().err
    assert not Path("a.xlsx").exists()


def test_evaluate_changes_settings_of_the_task_on_the_line_or_in_a_file(runs, capsys):
    changed = dataclasses.replace(mg.load(runs["hopper"]).task, penalty=0.5)
    outcome = mg.evaluate(mg.load(runs["hopper"]).with_task(changed), 60)
    assert outcome.reward.tolist() != mg.evaluate(mg.load(runs["hopper"]), 60).reward.tolist()
    options = ["--steps", 60, "--no-film", "--json", "e.json"]
    Path("e.toml").write_text(f'run = "{runs["hopper"]}"\n[task]\npenalty = 0.5\n')
    for given in ([runs["hopper"], "--task.penalty", 0.5], ["--config", "e.toml"]):
        assert status("evaluate", *given, *options) == 0
        assert read("e.json")["reward"]["per_seed"] == outcome.reward.tolist()
    capsys.readouterr()
    assert main(["evaluate", "--task.penalty", "1", str(runs["hopper"])]) == 2
    assert "--task.penalty: needs the run as the first word" in capsys.readouterr().err


@pytest.mark.ci
def test_evaluate_films_the_seed_that_is_asked_for(runs, capsys):
    options = ["--steps", 60, "--seconds", 0.5, "--seed", 4, "--video", "deep/in/hop.mp4", "--json", "e.json"]
    assert status("evaluate", runs["hopper"], *options) == 0
    frames = frames_of("deep/in/hop.mp4")
    assert len(frames) >= 10
    assert (frames[1:] != frames[0]).any()
    assert frames[0].std() > 5  # there is something to be seen
    assert "filmed seed 4, 0.5 s: deep/in/hop.mp4" in capsys.readouterr().out
    found = read("e.json")
    assert found["renderer"] in ("gl", "drawn")


@pytest.mark.ci
def test_evaluate_films_into_the_run_by_default(runs):
    assert status("evaluate", runs["hopper"], "--steps", 20, "--seconds", 0.2, "--json", "-") == 0
    assert len(frames_of(runs["hopper"] / "figures" / "evaluation.mp4"))


# ---- plot


@pytest.mark.representatives("hopper")
@pytest.mark.parametrize("name", SHARED)
def test_plot_draws_a_curve_into_the_run(name, runs, capsys):
    assert status("plot", runs[name]) == 0
    assert (runs[name] / "figures" / "reward.png").read_bytes().startswith(b"\x89PNG")
    assert "drawn to" in capsys.readouterr().out


def test_plot_draws_several_runs_and_any_quantity(runs):
    options = ["--quantity", "baseline", "--out", "both.svg", "--json", "p.json"]
    assert status("plot", runs["chain"], runs["hopper"], *options) == 0
    drawn = Path("both.svg").read_text()
    assert "<svg" in drawn
    assert read("p.json")["figure"] == "both.svg"


@pytest.mark.ci
def test_plot_draws_a_reading_that_never_occurred(runs):
    run = mg.train("hopper", steps=4, out="short", window=2, progress=False)
    assert np.isnan(run.curve("apex")[1]).all()
    assert status("plot", "short", "--quantity", "apex") == 0


# ---- refusals

REFUSED = [
    (["tran"], "unknown command 'tran': did you mean 'train'?"),
    (["train", "hoper"], "unknown task 'hoper': did you mean 'hopper'?"),
    (["train"], "tasks: arm-recruitment, call-admission, chain"),
    (["train", "chain", "--stps", 5], "unknown option '--stps': did you mean '--steps'?"),
    (["train", "chain", "--task.lenght", 5], "unknown setting of task 'lenght': did you mean 'length'?"),
    (["train", "chain", "--steps", "many"], "steps = 'many': must be an integer"),
    (["train", "chain", "--steps", 0], "steps = 0"),
    (["train", "chain", "--seeds", 0], "seeds"),
    (["train", "chain", "--seeds", -1], "seeds"),
    (["train", "chain", "--first-seed", -1], "seed"),
    (["train", "chain", "--window", 0], "window = 0"),
    (["train", "chain", "--checkpoint-every", -1], "checkpoint_every = -1.0"),
    (["train", "chain", "--threads", -1], "threads = -1"),
    (["train", "chain", "--task.length", 1], "length = 1"),
    (["train", "chain", "--task.variant", "rest"], "reset"),
    (["train", "chain", "--agent.policy", "softmx"], "softmax"),
    (["train", "chain", "--agent.policy", "hyperplanes"], "policy Hyperplanes"),
    (["train", "chain", "--agent.policy", "motoneurons"], "task 'chain' has 6 observed numbers"),
    (["train", "chain", "--agent.estimator", "olgarp"], "olgarb"),
    (["train", "chain", "--agent.decay", 1], "estimator.trace.decay = 1: needs episodes"),
    (["train", "chain", "--agent.learning-rate", "nan"], "agent.optimizer.learning_rate = nan: must be"),
    (["train", "chain", "--agent.learning-rate", "weight", 0.1], "'weight': did you mean 'weights'"),
    (["train", "hopper", "--task.penalty", -1], "penalty = -1.0"),
    (["train", "hopper", "--task.action-period", 0.0105], "action_period = 0.0105"),
    (["train", "hopper", "--task.body.load-mass", 0], "load_mass = 0.0"),
    (["evaluate"], "run"),
    (["evaluate", "nowhere"], "nowhere is not a run directory"),
    (["evaluate", "{runs[chain]}", "--steps", 0], "steps = 0"),
    (["evaluate", "{runs[chain]}", "--mode", "best"], "sample"),
    (["evaluate", "{runs[chain]}", "--seed", 0], "seed = 0: must be one of the run's seeds, [3, 4]"),
    (["evaluate", "{runs[hopper]}", "--steps", 2, "--seconds", 0], "seconds = 0.0"),
    (["evaluate", "{runs[hopper]}", "--steps", 2, "--seconds", "inf"], "seconds = inf"),
    (["plot"], "runs: must be given"),
    (["plot", "nowhere"], "nowhere is not a run directory"),
    (["plot", "{runs[chain]}", "--quantity", "rewards"], "unknown quantity 'rewards': did you mean 'reward'?"),
    (["plot", "{runs[chain]}", "--quantity", "apex"], "unknown quantity 'apex'"),
    (["plot", "{runs[chain]}", "--out", "curve.bmpp"], "bmpp"),
    (["demo", "--seconds", 0], "seconds = 0.0"),
    (["sim", "chain", "--record", "a.html", "--seconds", 121], "seconds = 121.0: must be at most 120"),
    (["demo", "--seconds", "nan"], "seconds = nan"),
    (["demo", "--seeds", 0], "seeds = "),
    (["demo", "--film-seconds", 0], "film_seconds = 0.0"),
    (["bench", "--quik"], "--quick"),
    (["list", "--jsn", "x"], "--json"),
]


@pytest.mark.parametrize(("arguments", "named"), REFUSED, ids=[" ".join(map(str, a)) for a, _ in REFUSED])
def test_what_cannot_be_done_is_refused_by_name(arguments, named, runs, tmp_path, capsys):
    assert status(*(str(argument).format(runs=runs) for argument in arguments)) == 2
    said = capsys.readouterr()
    assert named in said.err + said.out
    assert not list(tmp_path.rglob("config.toml"))  # refused before any work


def test_a_file_in_the_place_of_a_run_is_refused(tmp_path, capsys):
    (tmp_path / "taken").write_text("")
    for out in ("taken", "taken/run"):
        assert status("train", "chain", "--steps", 5, "--out", out) == 2
        assert "taken" in capsys.readouterr().err


# ---- processes


@pytest.mark.ci
def test_a_users_session_in_processes(compiled_environment, tmp_path, capsys):
    trained = process(compiled_environment, "train", "three-state", "--steps", 50, "--out", "x", "--json", "-")
    assert trained.returncode == 0, trained.stderr
    assert json.loads(trained.stdout)["complete"]
    # in this process, which is another
    assert status("train", "three-state", "--steps", 50, "--out", "x", "--agent.decay", 0.5) == 2
    again = capsys.readouterr()
    assert "agent.estimator.trace.decay was 0.8 and is now 0.5" in again.err
    assert "Traceback" not in again.err
    told = read(tmp_path / "x" / "provenance.json")["sessions"]
    assert told[0]["command"][1:4] == ["train", "three-state", "--steps"]


def test_the_installed_command_is_the_module(process_environment):
    command = os.path.join(os.path.dirname(sys.executable), "motorgrad")
    told = [
        subprocess.run([*program, "--help"], capture_output=True, text=True, env=process_environment, check=True).stdout
        for program in ([command], [sys.executable, "-m", "motorgrad"])
    ]
    assert told[0] == told[1]
    assert "usage: motorgrad" in told[0]
