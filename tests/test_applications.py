"""What other distributions add to the library: commands and all else, found by their entry points."""

import subprocess
import sys

import pytest

from motorgrad import _applications
from motorgrad._applications import OFFERED_COMMANDS, entries, film_maker, offered
from motorgrad._extras import MissingExtra
from motorgrad.commands import EXTRA_OF_COMMAND, command_named


def test_the_applications_of_this_checkout_offer_what_the_library_asks_for():
    assert set(entries(OFFERED_COMMANDS)) >= set(EXTRA_OF_COMMAND)
    for name in ("painter", "film", "motion of a run", "course of a run", "film of learning"):
        assert callable(offered(name, "a picture needs", "sim"))


def test_what_is_not_installed_is_named_with_what_installs_it(monkeypatch):
    monkeypatch.setattr(_applications, "entries", lambda group: {})
    with pytest.raises(MissingExtra, match=r"^a film needs .*: pip install 'motorgrad\[video\]'"):
        film_maker("film")
    for name, extra in EXTRA_OF_COMMAND.items():
        with pytest.raises(MissingExtra, match=rf"^this command needs .*: pip install 'motorgrad\[{extra}\]'"):
            command_named(name)


def test_a_command_of_another_distribution_is_found(tmp_path, process_environment):
    told = tmp_path / "greeter-1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text("Metadata-Version: 2.1\nName: greeter\nVersion: 1.0\n")
    (told / "entry_points.txt").write_text(f"[{OFFERED_COMMANDS}]\ngreet = greeter:run\n")
    (tmp_path / "greeter.py").write_text("def run(arguments):\n    print('hello', *arguments)\n    return 0\n")
    path = ":".join([str(tmp_path), *filter(None, [process_environment.get("PYTHONPATH")])])

    def said(*words):
        command = [sys.executable, "-m", "motorgrad", *words]
        environment = process_environment | {"PYTHONPATH": path}
        return subprocess.run(command, capture_output=True, text=True, env=environment, cwd=tmp_path, check=True).stdout

    assert said("greet", "you") == "hello you\n"
    assert "  greet      of the package greeter\n" in said("--help")
