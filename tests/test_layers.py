"""The shape of the house: imports point down, between packages and between the library's rooms, through front doors."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

import motorgrad
import motorgrad_thesis
import timlab
import timsim
from motorgrad.commands import COMMANDS, EXTRA_OF_COMMAND, command_named

ROOT = Path(motorgrad.__file__).parent
PACKAGES = {each.__name__: Path(each.__file__).parent for each in (motorgrad, timsim, timlab, motorgrad_thesis)}
USES = {
    "motorgrad": set(),
    "timsim": {"motorgrad"},
    "timlab": {"motorgrad"},
    "motorgrad_thesis": {"motorgrad", "timsim"},
}
"""What each package may import beside itself."""

# What a room may import beside its own files: the rooms below it, and what is under all of them.
ANYWHERE = {"schema"} | {file.stem for file in ROOT.glob("_*.py")} - {"__init__", "__main__"}
LEARNING = {"policies", "learning"}
DYNAMICS = {"bodies", "worlds"}
BELOW = {
    "statistics": set(),
    "export": set(),
    "pages": set(),
    "policies": {"export"},
    "learning": {"policies"},
    "search": set(),
    "bodies": set(),
    "worlds": {"policies"},  # the oracle is exact about any policy of ours
    "tasks": DYNAMICS,
    "plane": {"tasks", "worlds", "policies"},
    "training": {"search", "tasks", "statistics"} | DYNAMICS | LEARNING,
    "studies": {"training", "tasks", "statistics"},
    "presets": {"training"},
    "environments": {"tasks"} | DYNAMICS,
    "benchmarks": {"environments", "presets", "training", "tasks"} | DYNAMICS | LEARNING,
    "options": {"studies", "training", "tasks"} | LEARNING,
    "commands": {"options", "benchmarks", "studies", "training", "tasks"} | DYNAMICS | LEARNING,
    "cli": {"commands"},
    "__main__": {"cli"},
}
FILES = [(name, file) for name, root in PACKAGES.items() for file in sorted(root.rglob("*.py"))]


def room_of(file):
    """The room of the library that a file belongs to."""
    return file.relative_to(ROOT).parts[0].removesuffix(".py")


def statements(block):
    """Every statement within a block, wherever: an import is one, and to look into expressions takes long."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for node in getattr(block, part, ()):
            yield node
            if not isinstance(node, ast.Expr):
                yield from statements(node)


def imported(file, package, root):
    """Every module of our packages that a file of a package imports, wherever in it, as (line, parts of its name)."""
    own = [package, *file.relative_to(root).parts[:-1]]
    for node in statements(ast.parse(file.read_text(), str(file))):
        if isinstance(node, ast.Import):
            found = [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = own[: len(own) - node.level + 1] if node.level else []
            base = ".".join([*start, *([node.module] if node.module else [])])
            found = [(node.lineno, f"{base}.{alias.name}") for alias in node.names]  # b of `from a import b`: a module?
        else:
            continue
        yield from ((line, name.split(".")) for line, name in found if name.split(".")[0] in PACKAGES)


def test_every_room_has_its_place():
    rooms = {room_of(file) for name, file in FILES if name == "motorgrad" and file != ROOT / "__init__.py"}
    assert rooms - ANYWHERE == set(BELOW)


def test_the_tables_themselves_point_down():
    for table in (BELOW, USES):
        order = list(table)
        for name, below in table.items():
            assert all(order.index(other) < order.index(name) for other in below)


@pytest.mark.parametrize(
    ("package", "file"), FILES, ids=[str(file.relative_to(PACKAGES[n].parent)) for n, file in FILES]
)
def test_imports_point_down_and_go_through_the_front_door(package, file):
    home = room_of(file) if package == "motorgrad" and file != ROOT / "__init__.py" else ""
    wrong = []
    for line, (other, *beyond) in imported(file, package, PACKAGES[package]):
        if other != package and other not in USES[package]:
            wrong.append(f"line {line}: {package} imports {other}")
        if other == "motorgrad" and beyond and beyond[0] not in (home, "__version__"):
            room, *rest = beyond
            # the private files under all rooms know no room themselves
            allowed = ANYWHERE | BELOW.get(home, set()) if home else ANYWHERE | set(BELOW) | set(motorgrad.__all__)
            if room not in allowed:
                wrong.append(f"line {line}: {home or package} imports {room}, which is not below it")
            if rest and rest[0].startswith("_"):
                wrong.append(f"line {line}: {room}.{rest[0]} is private to {room}")
        elif other != package and beyond and beyond[0].startswith("_"):
            wrong.append(f"line {line}: {other}.{beyond[0]} is private to {other}")
    assert not wrong


def test_the_walk_over_imports_sees_every_kind(tmp_path):
    (tmp_path / "tasks").mkdir()
    file = tmp_path / "tasks" / "_x.py"
    file.write_text(
        "import motorgrad.training\nfrom motorgrad import tasks\nfrom motorgrad.bodies._batch import BodyBatch\n"
        "def f():\n    from ..learning import Agent\n    from . import y\n    import numpy\n    import timsim.film\n"
        "class C:\n    async def f():\n        for x in y:\n            with z:\n"
        "                import motorgrad.worlds\n"
        "try:\n    pass\nexcept E:\n    import motorgrad.search\nelse:\n    import motorgrad.export\n"
        "finally:\n    import timlab\n"
        "match a:\n    case 1:\n        if b:\n            pass\n        else:\n            import motorgrad.cli\n"
    )
    found = {".".join(name) for _, name in imported(file, "motorgrad", tmp_path)}
    inside = {"tasks", "bodies._batch.BodyBatch", "learning.Agent", "tasks.y"}
    inside |= {"training", "worlds", "search", "export", "cli"}
    assert found == {f"motorgrad.{name}" for name in inside} | {"timsim.film", "timlab"}


ROOMS = [f"motorgrad.{room}" for room in BELOW if (ROOT / room / "__init__.py").exists() and room != "commands"]
ROOMS += [name for name in PACKAGES if name != "motorgrad"]


@pytest.mark.parametrize("room", ROOMS)
def test_public_names_exist_and_explain_themselves(room):
    module = importlib.import_module(room)
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
    module = importlib.import_module(room)
    taken = {
        alias.asname or alias.name
        for node in ast.parse(Path(module.__file__).read_text()).body
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES
        for alias in node.names
        if alias.name != "*"  # a registry, whose entries are exported as they are
        and not (alias.asname or "").startswith("_")
    }
    defined = {name for name in vars(module) if not name.startswith("_") and name in module.__all__}
    assert taken <= set(module.__all__)
    assert defined == set(module.__all__)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_found_and_explains_itself(name):
    command = command_named(name)
    assert callable(command)
    assert importlib.import_module(command.__module__).__doc__.startswith(f"`motorgrad {name}")


def test_every_module_of_a_command_is_a_command():
    found = {file.stem for file in (ROOT / "commands").glob("*.py") if not file.stem.startswith("_")}
    assert found == set(COMMANDS) - set(EXTRA_OF_COMMAND)
