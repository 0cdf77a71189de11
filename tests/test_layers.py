"""The shape of the house: imports point down the rooms, and a room is entered through its front door."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

import motorgrad
from motorgrad.cli import COMMANDS

ROOT = Path(motorgrad.__file__).parent

# What a room may import beside its own files: the rooms below it, and the private files under all of them.
ANYWHERE = {file.stem for file in ROOT.glob("_*.py")} - {"__init__", "__main__"}
LEARNING = {"policies", "learning"}
DYNAMICS = {"bodies", "worlds"}
BELOW = {
    "statistics": set(),
    "export": set(),
    "policies": {"export"},
    "learning": {"policies"},
    "search": set(),
    "bodies": set(),
    "worlds": {"policies"},  # the oracle is exact about any policy of ours
    "tasks": DYNAMICS,
    "training": {"search", "tasks", "statistics"} | DYNAMICS | LEARNING,
    "studies": {"training", "tasks", "statistics"},
    "presets": {"training", "tasks", "learning"},
    "sim": {"training", "tasks"} | DYNAMICS | LEARNING,  # it shows bodies and learners, and lets them learn
    "environments": {"tasks", "sim"} | DYNAMICS,
    "experiments": {"studies", "training", "tasks", "sim", "search", "statistics"} | DYNAMICS | LEARNING,
    "lab": {"environments", "sim", "tasks", "training", "export"} | DYNAMICS | LEARNING,
    "benchmarks": {"environments", "lab", "presets", "training", "tasks", "sim"} | DYNAMICS | LEARNING,
    "_commands": {"benchmarks", "lab", "experiments", "studies", "training", "tasks", "sim"} | DYNAMICS | LEARNING,
    "cli": {"_commands"},
    "__main__": {"cli"},
}
FILES = sorted(file for file in ROOT.rglob("*.py") if file.parent != ROOT or file.name != "__init__.py")


def room_of(file):
    """The room that a file belongs to."""
    return file.relative_to(ROOT).parts[0].removesuffix(".py")


def statements(block):
    """Every statement within a block, wherever: an import is one, and to look into expressions takes long."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for node in getattr(block, part, ()):
            yield node
            if not isinstance(node, ast.Expr):
                yield from statements(node)


def imported(file):
    """Every module of this library that a file imports, wherever in the file, as (line, dotted name)."""
    package = ["motorgrad", *file.relative_to(ROOT).parts[:-1]]
    for node in statements(ast.parse(file.read_text(), str(file))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names if alias.name.split(".")[0] == "motorgrad")
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*start, *([node.module] if node.module else [])])
            if base.split(".")[0] == "motorgrad":
                # `from motorgrad.a import b`: b may be a module
                yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def crossings(file):
    """The imports that leave a file's own room, as (line, the other room, the parts of the name beyond it)."""
    for line, name in imported(file):
        parts = name.split(".")
        if len(parts) > 1 and parts[1] != room_of(file):
            yield line, parts[1], parts[2:]


def test_every_room_has_its_place():
    assert {room_of(file) for file in FILES} - ANYWHERE == set(BELOW)


def test_the_table_itself_points_down():
    order = list(BELOW)
    for room, below in BELOW.items():
        assert all(order.index(other) < order.index(room) for other in below)


@pytest.mark.parametrize("file", FILES, ids=[str(file.relative_to(ROOT)) for file in FILES])
def test_imports_point_down_and_go_through_the_front_door(file):
    # the private files under all rooms know no room themselves
    allowed = ANYWHERE | BELOW.get(room_of(file), set())
    wrong = []
    for line, room, beyond in crossings(file):
        if room == "__version__":
            continue
        if room not in allowed:
            wrong.append(f"line {line}: {room_of(file)} imports {room}, which is not below it")
        if room not in ANYWHERE and beyond and beyond[0].startswith("_"):
            wrong.append(f"line {line}: {room}.{beyond[0]} is private to {room}")
    assert not wrong


def test_the_walk_over_imports_sees_every_kind(tmp_path, monkeypatch):
    monkeypatch.setattr("test_layers.ROOT", tmp_path)
    (tmp_path / "sim").mkdir()
    file = tmp_path / "sim" / "_x.py"
    file.write_text(
        "import motorgrad.training\nfrom motorgrad import tasks\nfrom motorgrad.bodies._batch import BodyBatch\n"
        "def f():\n    from ..learning import Agent\n    from . import y\n    import numpy\n"
        "class C:\n    async def f():\n        for x in y:\n            with z:\n"
        "                import motorgrad.worlds\n"
        "try:\n    pass\nexcept E:\n    import motorgrad.search\nelse:\n    import motorgrad.export\n"
        "finally:\n    import motorgrad.lab\n"
        "match a:\n    case 1:\n        if b:\n            pass\n        else:\n            import motorgrad.cli\n"
    )
    found = {(room, tuple(beyond)) for _, room, beyond in crossings(file)}
    assert found == {
        ("training", ()),
        ("tasks", ()),
        ("bodies", ("_batch", "BodyBatch")),
        ("learning", ("Agent",)),
        *((room, ()) for room in ("worlds", "search", "export", "lab", "cli")),
    }


ROOMS = [room for room in BELOW if (ROOT / room / "__init__.py").exists() and not room.startswith("_")]


@pytest.mark.parametrize("room", ROOMS)
def test_public_names_exist_and_explain_themselves(room):
    module = importlib.import_module(f"motorgrad.{room}")
    assert module.__doc__
    assert module.__all__
    assert len(set(module.__all__)) == len(module.__all__)
    silent = []
    for name in module.__all__:
        thing = getattr(module, name)
        # a constant is explained where it stands, which is not kept at run time
        if (inspect.isclass(thing) or inspect.isroutine(thing) or inspect.ismodule(thing)) and not own_words(thing):
            silent.append(name)
    assert not silent


def own_words(thing):
    """A docstring that is the thing's own: none inherited, and not the signature that a dataclass is given."""
    words = thing.__doc__ or ""
    return words if not words.startswith(f"{thing.__name__.rpartition('.')[2]}(") else ""


@pytest.mark.parametrize("room", ROOMS)
def test_public_names_are_what_the_front_door_imports(room):
    module = importlib.import_module(f"motorgrad.{room}")
    taken = {
        alias.asname or alias.name
        for node in ast.parse((ROOT / room / "__init__.py").read_text()).body
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("motorgrad")
        for alias in node.names
        if alias.name != "*"  # a registry, whose entries are exported as they are
        and not (alias.asname or "").startswith("_")
    }
    defined = {name for name in vars(module) if not name.startswith("_") and name in module.__all__}
    assert taken <= set(module.__all__)
    assert defined == set(module.__all__)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_a_module(name):
    module = importlib.import_module(f"motorgrad._commands.{name}")
    assert callable(module.run)
    assert module.__doc__.startswith(f"`motorgrad {name}")


def test_every_module_of_a_command_is_a_command():
    found = {file.stem for file in (ROOT / "_commands").glob("*.py") if not file.stem.startswith("_")}
    assert found == set(COMMANDS)
