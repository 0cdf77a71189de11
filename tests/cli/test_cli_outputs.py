"""What a file of options may not choose: who reaches the page, and files that somebody else wrote."""

import dataclasses
import importlib
import os
import shutil
import typing
from pathlib import Path

import pytest

from motorgrad.cli import main
from motorgrad.commands import COMMANDS, command_named
from motorgrad.options import ASKED, OUTPUTS

READ = {"run", "runs", "runs_beside", "resume", "study", "motion"}
"""Options with the path of something that is read, or, as `resume`, continued where it is a run."""
MINE = "mine"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def status(*arguments):
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as left:
        return left.code


def write(path, text):
    Path(path).write_text(text)
    return path


def classes():
    """Every class of options, by its command."""
    for command in COMMANDS:
        module = importlib.import_module(command_named(command).__module__)
        for cls in vars(module).values():
            if (
                isinstance(cls, type)
                and dataclasses.is_dataclass(cls)
                and cls.__module__.startswith(module.__package__)
            ):
                yield command, cls


def test_every_option_with_a_path_is_read_or_limited():
    """A new one has to be put into one of the two, or a file may choose what it replaces."""
    found = {
        (command, name)
        for command, cls in classes()
        for name, hint in typing.get_type_hints(cls).items()
        if name in {field.name for field in dataclasses.fields(cls)} and "Path" in str(hint)
    }
    assert {name for _, name in found} == READ | {*OUTPUTS}


REFUSED = [
    ("train chain", "out = 'mine'", "--out"),
    ("train chain", "json = 'mine'", "--json"),
    ("train chain", "json = 'mine.json'", "--json"),
    ("list", "json = 'mine'", "--json"),
    ("bench", "json = 'link'", "--json"),
    ("demo", "out = 'folder'", "--out"),
    ("demo", "json = 'mine'", "--json"),
    ("sweep", "study = 'x.toml'\njson = 'mine'", "--json"),
    ("compare", "study = 'x.toml'\nout = 'folder'", "--out"),
    ("reproduce", "experiments = ['fig-2.2']\nout = 'folder'", "--out"),
    ("plot", "runs = ['x']\nout = 'mine.svg'", "--out"),
    ("plot", "runs = ['x']\nout = 'photo'", "--out"),  # an ending is added
    ("plot", "runs = ['x']\nout = 'photo'\nformat = 'png'", "--out"),
    ("plot", "runs = ['x']\nout = 'site'", "--out"),  # the figure's name is added
    ("plot", "runs = ['x']\nanimate = ['mine.svg']", "--animate"),
    ("plot", "runs = ['x']\ntensorboard = ['folder']", "--tensorboard"),
    ("export", "run = 'x'\nfile = 'mine'", "--file"),
    ("sim chain", "record = 'mine.mp4'", "--record"),
    ("sim hopper", "record = 'mine.html'", "--record"),
    ("sim chain", "autosave = 'folder'", "--autosave"),
]


@pytest.fixture
def things():
    """What is not motorgrad's."""
    Path("site").mkdir()
    for name in ("mine", "mine.svg", "mine.mp4", "mine.html", "photo.png", "site/config.toml", "site/reward.png"):
        write(name, MINE)
    write("mine.json", '{"name": "a package"}')
    Path("folder").mkdir()
    write("folder/mine", MINE)
    os.symlink("mine", "link")
    return {name: name.read_text() for name in Path().rglob("*") if name.is_file()}


@pytest.mark.parametrize(("command", "text", "flag"), REFUSED, ids=[f"{c}: {t!r}" for c, t, _ in REFUSED])
def test_a_file_replaces_nothing_that_motorgrad_did_not_write(command, text, flag, things, capsys):
    assert status(*command.split(), "--config", write("a.toml", text)) == 2
    said = capsys.readouterr().err
    assert "a.toml" in said
    assert f"{flag} on the command line replaces it" in said
    assert said.count("\n") == 1
    assert {name: name.read_text() for name in things} == things


@pytest.mark.parametrize("command", ["sim chain", "sim hopper", "sim"])
def test_a_scene_does_not_choose_who_reaches_the_page(command, capsys):
    """As it did, by a file that says where to listen: on all networks, with a page that drives the program."""
    text = "host = '0.0.0.0'\n" + ("body = 'hopper'\n" if command == "sim" else "")
    assert status(*command.split(), "--config", write("a.toml", text), "--check") == 2
    assert "a.toml: host = '0.0.0.0': must be an option of the command line" in capsys.readouterr().err
    assert "host" in ASKED


def test_what_motorgrad_wrote_goes_on_and_the_command_line_decides(capsys):
    file = write("a.toml", "steps = 20\nout = 'run'\njson = 'r.json'\n[task]\nname = 'chain'\n")
    assert status("train", "--config", file) == 0
    assert status("train", "--config", file, "--steps", 30) == 0
    shutil.copy("a.toml", "r.json")
    assert status("train", "--config", file, "--steps", 30, "--check") == 2
    assert status("train", "--config", file, "--steps", 30, "--json=r.json", "--check") == 0
    assert status("train", "--config", file, "--steps", 30, "--json", "r.json") == 0
    assert status("train", "--config", file, "--steps", 30) == 0
    capsys.readouterr()
