"""What a user is told who asks for help, or asks for something that cannot be."""

import dataclasses
import importlib
import os
import subprocess
import sys
import tomllib

import numpy as np
import pytest

import motorgrad as mg
from motorgrad._errors import counted
from motorgrad._processes import IMPORTED
from motorgrad.cli import main
from motorgrad.commands import COMMANDS, command_named
from motorgrad.learning import SGD, Adam
from motorgrad.options import print_place, summary, summary_text
from motorgrad.policies import motoneurons
from motorgrad.schema import PART_CLASSES, as_hinted, default_of, descriptions, fields_of
from motorgrad.tasks import TASKS, from_gymnasium
from motorgrad.training import agent_for
from motorgrad_thesis import EXPERIMENTS


def said(capsys, *arguments: str) -> tuple[int, str]:
    """The status of a command and its words, without the frames around them."""
    capsys.readouterr()
    try:
        status = main(list(arguments))
    except SystemExit as end:
        status = int(end.code or 0)
    captured = capsys.readouterr()
    return status, " ".join((captured.out + captured.err).replace("│", " ").split())


def tables(cls: type) -> list[type]:
    """A class of settings, and those of the tables within it."""
    inner = [type(default_of(field)) for field in fields_of(cls).values()]
    return [cls, *(found for kind in inner if dataclasses.is_dataclass(kind) for found in tables(kind))]


PARTS = [cls for kinds in PART_CLASSES.values() for cls in kinds.values()]
SETTINGS = {found: None for cls in (*EXPERIMENTS.values(), *TASKS.values(), *PARTS) for found in tables(cls)}


@pytest.mark.parametrize("cls", SETTINGS, ids=lambda cls: cls.__qualname__)
def test_every_setting_that_help_shows_is_described(cls):
    described = descriptions(cls)
    assert [name for name in fields_of(cls) if len(described.get(name, "")) <= 10] == []


def test_the_help_of_an_experiment_says_what_its_settings_are(capsys):
    status, text = said(capsys, "reproduce", "fig-5.5", "--help")
    assert status == 0
    assert "The step size of all parameters. (default: 0.0005, at least 0)" in text
    assert "Length of every hopper's practice. (default: 1500 simulated s, above 0)" in text
    assert "Number of independent hoppers. (default: 16, from 1 to 10,000)" in text


def test_symbols_keep_their_letters():
    body = descriptions(mg.bodies.Hopper)
    assert body["capsule_radius"].startswith("Radius ρ of")
    assert body["muscle_damping"].startswith("Damping k_SE of")
    assert body["load_mass"].startswith("Mass of the load")


def test_the_help_of_several_words_is_short(capsys):
    _, text = said(capsys, "train", "gymnasium", "--help-all")
    for option in ("--task.kwargs", "--agent.optimizer.learning-rate FLOAT |"):
        assert f"{option} NAME VALUE ... " in text
    assert "--seeds INT ... " in text
    assert "{[" not in text


def test_an_option_that_may_be_left_out_shows_its_value_and_no_none(capsys):
    for command in (["plot"], ["export"], ["sweep"], ["train", "hopper"]):
        text = said(capsys, *command, "--help")[1]
        assert "None" not in text
        assert "--config PATH A TOML file of options. The command line overrides it. --check" in text
    assert "usage: motorgrad export [-h] [OPTIONS] RUN FILE " in said(capsys, "export", "--help")[1]
    assert "--x {decisions,simulated,wall,cpu} " in said(capsys, "plot", "--help")[1]


def test_what_is_required_has_no_empty_default(capsys):
    _, text = said(capsys, "reproduce", "--help")
    assert "or all. (required)" in text
    assert "(default: )" not in text


@pytest.mark.parametrize(
    ("words", "wrong"),
    [
        ((), "= 'nothing': must be names and values in turn"),
        (("weights",), "= 'weights': must be a number or a table or an Annealed"),
        (("weights", "0.1", "bias"), "= 'bias': must be names and values in turn: it has no value"),
    ],
)
def test_names_without_values_are_refused_by_option(words, wrong, capsys):
    status, text = said(capsys, "train", "hopper", "--check", "--agent.learning-rate", *words)
    assert status == 2
    assert f"agent.optimizer.learning_rate {wrong}" in text


def test_names_and_values_are_read_as_what_they_are(capsys):
    checked = ("train", "gymnasium", "--check", "--task.env-id")
    words = ("g", "1e1", "render_mode", "rgb_array", "max_episode_steps", "30")
    with pytest.raises(SystemExit, match="0"):
        main([*checked, "Pendulum-v1", "--task.kwargs", *words])
    table = tomllib.loads(capsys.readouterr().out)
    assert table["agent"]["policy"]["kind"] == "bounded-hyperplanes"  # the learner is that of the task as asked for
    found = table["task"]["kwargs"]
    assert found == {"g": 10.0, "render_mode": "rgb_array", "max_episode_steps": 30}
    assert [type(value) for value in found.values()] == [float, str, int]
    with pytest.raises(SystemExit, match="0"):
        main([*checked, "CartPole-v1", "--task.kwargs", "sutton_barto_reward", "True"])
    table = tomllib.loads(capsys.readouterr().out)
    assert table["task"]["kwargs"]["sutton_barto_reward"] is True
    assert table["agent"]["policy"]["kind"] == "softmax"


@pytest.mark.ci
def test_none_takes_the_names_and_values_of_a_file_back(capsys, tmp_path):
    file = tmp_path / "a.toml"
    file.write_text("[agent]\nweight_decay = {weights = 0.1, bias = 0.2}\n", encoding="utf-8")
    command = ("train", "hopper", "--config", str(file), "--check")
    assert "[agent.optimizer.weight_decay]" in said(capsys, *command, "--steps", "5")[1]
    assert "[agent.optimizer.weight_decay]" not in said(capsys, *command, "--agent.weight-decay", "None")[1]


# ---- a setting at the wrong level


def test_a_setting_at_the_wrong_level_of_a_file_is_shown_its_place(capsys, tmp_path):
    file = tmp_path / "a.toml"
    for line, place in (
        ("penalty = 0.1", "'task.penalty'"),
        ("load_mass = 3", "'task.body.load_mass'"),
        ("[task]\nload_mass = 3", "'body.load_mass'"),
        ("decay = 0.5", "'agent.estimator.trace.decay'"),
        ("units = 4", "'task.units' or 'agent.policy.units'"),
    ):
        file.write_text(line, encoding="utf-8")
        status, text = said(capsys, "train", "hopper", "--config", str(file))
        assert status == 2
        assert f"did you mean {place}? known are" in text


def test_a_setting_that_could_stand_in_two_tables_is_shown_both(capsys, tmp_path):
    file = tmp_path / "a.toml"
    file.write_text("length = 4\n[agent]\ntrace = 'window'", encoding="utf-8")
    wanted = "did you mean 'task.length' or 'agent.estimator.trace.length'?"
    assert wanted in said(capsys, "train", "chain", "--config", str(file))[1]


def test_a_bodys_setting_given_to_its_task_is_shown_its_place():
    with pytest.raises(ValueError, match=r"unknown setting of hopper 'load_mass': did you mean 'body\.load_mass'\?"):
        mg.make("hopper", load_mass=3)


# ---- whole numbers


def test_a_whole_number_may_be_written_with_an_exponent(capsys, tmp_path):
    file = tmp_path / "a.toml"
    file.write_text("steps = 2e5\nseeds = 1e1", encoding="utf-8")
    found = said(capsys, "train", "hopper", "--config", str(file), "--check")[1]
    assert "steps = 200000 seeds = 10 " in found
    assert (
        "steps = 100000 seeds = 20 "
        in said(capsys, "train", "hopper", "--steps", "1e5", "--seeds", "2e1", "--check")[1]
    )
    made = as_hinted(int, 1e5, "steps")
    assert (made, type(made)) == (100_000, int)


@pytest.mark.parametrize("value", [0.5, 2.0**53 * 4, float("inf"), float("nan"), True, "3"])
def test_what_is_no_exact_whole_number_is_refused(value):
    with pytest.raises(ValueError, match=r"steps = .*: must be an integer"):
        as_hinted(int, value, "steps")


def test_a_number_that_may_be_either_stays_what_it_is():
    either = as_hinted(bool | int | float | str, 10.0, "kwargs.g")
    assert (either, type(either)) == (10.0, float)


@pytest.mark.parametrize(
    ("word", "wrong"),
    [
        ("100,000", "'100,000': must be an integer: write 100000"),
        ("1.5", "1.5: must be an integer"),
        ("nan", "nan: must be an integer"),
    ],
)
def test_a_word_that_is_no_integer_is_refused_by_option(word, wrong, capsys):
    status, text = said(capsys, "train", "hopper", "--steps", word, "--check")
    assert status == 2
    assert f"steps = {wrong}" in text


# ---- models


@pytest.mark.parametrize("content", [None, "<mujoco><worldbody><body/></worldbod>"], ids=["missing", "not XML"])
def test_a_check_of_a_model_reads_its_file(content, capsys, tmp_path):
    file = tmp_path / "leg.xml"
    if content is not None:
        file.write_text(content, encoding="utf-8")
    status, text = said(capsys, "sim", str(file), "--check")
    assert status == 2
    assert "leg.xml" in text


# ---- in Python


def test_agents_go_by_a_tasks_name():
    assert agent_for("hopper", decay=0.5) == agent_for(mg.make("hopper"), decay=0.5)
    with pytest.raises(ValueError, match="unknown task 'hoper': did you mean 'hopper'"):
        agent_for("hoper")
    with pytest.raises(ValueError, match="task = 3: must be a task, or the name of one"):
        agent_for(3)  # type: ignore[arg-type]


@pytest.mark.parametrize("rule", [SGD, Adam])
@pytest.mark.parametrize("rate", ["a", None, [[1.0], [1.0, 2.0]], 1j, True], ids=str)
def test_a_step_size_that_is_no_number_is_refused_by_name(rule, rate):
    with pytest.raises(ValueError, match=r"learning_rate = .*: must be a finite number.* or a mapping from groups"):
        rule(rate)
    with pytest.raises(ValueError, match=r"learning_rate.bias = .*: must be a finite number of at least 0"):
        rule({"weights": 0.1, "bias": rate})


def test_motoneurons_name_the_task_that_they_do_not_go_with(capsys):
    status, text = said(capsys, "train", "hopper", "--agent.policy", "motoneurons", "--check")
    wanted = "policy = 'motoneurons': task 'hopper' has 3 observed numbers, a motoneuron has a single input"
    assert status == 2
    assert wanted in text
    with pytest.raises(ValueError, match="inputs = 3: must be 1: a motoneuron has a single input"):
        motoneurons(3, 2)


def test_a_space_is_refused_with_its_size():
    with pytest.raises(ValueError, match=r"observations in a Discrete\(500\) space"):
        from_gymnasium("Taxi-v3")


def test_a_summary_says_of_how_many_seeds_it_is():
    every, some = summary([1.0, 2.0, 3.0]), summary([1.0, np.nan, 3.0])
    assert summary_text("apex", every) == "apex: median 2 [quartiles 1.5 … 2.5] over 3 seeds"
    assert summary_text("apex", some) == "apex: median 2 [quartiles 1.5 … 2.5] over 2 of 3 seeds"
    assert summary_text("apex", summary([np.nan])) == "apex: never occurred"


def test_a_warning_is_one_line_without_the_place_in_the_code(tmp_path):
    code = "from motorgrad import cli; import warnings, sys; sys.argv[1:] = ['list', '--json', 'out.json'];"
    code += "cli.main = lambda: warnings.warn('\\x1b[33mWARN: too\\nold\\x1b[0m', UserWarning) or 0; cli.run()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "motorgrad: warning: too old\n")


def test_every_option_says_what_it_is():
    for name in COMMANDS:
        module = importlib.import_module(command_named(name).__module__)
        classes = [value for value in vars(module).values() if dataclasses.is_dataclass(value)]
        for cls in (each for each in classes if each.__module__ == module.__name__):
            assert set(fields_of(cls)) - set(descriptions(cls)) <= {"task", "agent"}, f"{name}: {cls.__name__}"


def test_the_text_of_an_option_breaks_only_at_the_edge(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "300")
    with pytest.raises(SystemExit, match="0"):
        main(["plot", "--help"])
    assert "processor (cpu) time; by default simulated seconds where the task has them." in capsys.readouterr().out


def test_one_is_counted_in_the_singular():
    assert [counted(n, "seed") for n in (0, 1, 2000)] == ["0 seeds", "1 seed", "2,000 seeds"]


STEERING = "\x1b]0;title\x07\x1b[2K\u202etxt"


def test_nothing_that_a_file_or_a_folder_is_called_steers_the_terminal(tmp_path, monkeypatch, capsys):
    """As names did that erased the line that warned of them, or turned its letters around."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / STEERING).mkdir()
    for command in ([STEERING], ["evaluate", STEERING], ["sweep", f"{STEERING}.toml"]):
        _, words = said(capsys, *command)
        assert words.isprintable(), command
    print_place(SimpleResults(tmp_path / STEERING), "", "study")
    words = capsys.readouterr().out
    assert words.replace("\n", "").isprintable()
    assert r"set aside after 3 attempts: 0000-chain: \x1b]0;title\x07" in words


class SimpleResults:
    """What is told of a study's results."""

    complete = True
    failures = ({"attempts": 3, "job": "0000-chain", "message": STEERING},)

    def __init__(self, path):
        self.path = path


def test_a_name_that_is_no_text_is_told_and_ends_nothing(tmp_path, compiled_environment):
    """As it did after the work was done: the status said that it had failed."""
    folder = os.path.join(os.fsencode(tmp_path), b"\xff\xfe")
    os.mkdir(folder)
    write = "import sys; from motorgrad import cli; cli.main = lambda: print(sys.argv[1]) or 0; cli.run()"
    done = subprocess.run([sys.executable, "-c", write, folder], env=compiled_environment, capture_output=True)
    assert done.returncode == 0
    assert done.stdout.endswith(b"\\udcff\\udcfe\n")


def test_what_a_command_imports_is_not_imported_by_the_next(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "parts_of_mine.py").write_text("")
    assert main(["--import", str(tmp_path / "parts_of_mine.py"), "--version"]) == 0
    assert IMPORTED == ["parts_of_mine"]
    assert main(["--version"]) == 0
    assert IMPORTED == []
    monkeypatch.delitem(sys.modules, "parts_of_mine")
