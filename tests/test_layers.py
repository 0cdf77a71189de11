"""The shape of the house: imports point down, private files stay private, public names are documented."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

import motorgrad
from motorgrad.cli import COMMANDS

ROOT = Path(motorgrad.__file__).parent
# From the top down; a room may import those after it. Rooms on one line do not know each other.
FLOORS = (
    ("__main__",),
    ("cli",),
    ("_commands",),
    ("benchmarks", "experiments"),
    ("training", "sim"),
    ("tasks",),
    ("worlds", "bodies"),
    ("learning",),
    ("policies",),
    ("_settings",),
    ("_errors", "_files"),
)
LEVEL = {room: level for level, rooms in enumerate(FLOORS) for room in rooms}
ROOMS = [room for room in LEVEL if (ROOT / room).is_dir()]


def room_of(file: Path) -> str:
    return file.relative_to(ROOT).parts[0].removesuffix(".py")


def imports(file: Path) -> list[tuple[str, str]]:
    """(room, rest of the module's name) of all that a file imports from this package, wherever it stands."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        names = [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module == "motorgrad":
            names = [f"motorgrad.{alias.name}" for alias in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "motorgrad" and len(parts) > 1:
                found.append((parts[1], ".".join(parts[2:])))
    return found


FILES = [file for file in sorted(ROOT.rglob("*.py")) if file != ROOT / "__init__.py"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_imports_point_down_and_respect_privacy(file):
    room = room_of(file)
    assert room in LEVEL, f"{room} has no place in the house: add it to FLOORS"
    for other, rest in imports(file):
        if other == room:
            continue
        if other in LEVEL:
            assert LEVEL[other] > LEVEL[room], f"{room} imports {other}, which is not below it"
        private = rest.split(".")[0].startswith("_") if rest else False
        assert not private, f"{room} imports motorgrad.{other}.{rest}, a private file of another room"


@pytest.mark.parametrize("room", [room for room in ROOMS if not room.startswith("_")])
def test_public_names_are_documented(room):
    module = importlib.import_module(f"motorgrad.{room}")
    assert inspect.getdoc(module)
    for name in module.__all__:
        thing = getattr(module, name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert thing.__doc__, f"motorgrad.{room}.{name} has no docstring"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_its_module(command):
    assert callable(importlib.import_module(f"motorgrad._commands.{command}").run)
