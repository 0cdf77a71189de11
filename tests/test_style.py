"""How code is written: what the linter has no rule for."""

import ast

import pytest

from test_layers import FILES, PACKAGES

IDS = [f"{name}/{file.relative_to(PACKAGES[name])}" for name, file in FILES]


def packed(tree):
    """The lines of assignments that pack several values into a tuple, where one of them is more than a name.

    A value that is assigned to where another is read, as in `before, now = now, before + now`, has no other way.
    """
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple)):
            continue
        (target, *others), values = node.targets, node.value.elts
        if others or not isinstance(target, ast.Tuple) or any(isinstance(each, ast.Starred) for each in target.elts):
            continue
        assigned = {each.id for each in ast.walk(target) if isinstance(each, ast.Name)}
        read = {each.id for value in values for each in ast.walk(value) if isinstance(each, ast.Name)}
        if not assigned & read and not all(isinstance(value, ast.Name | ast.Attribute) for value in values):
            yield node.lineno


@pytest.mark.parametrize(
    ("package", "file"), FILES, ids=[f"{name}/{file.relative_to(PACKAGES[name])}" for name, file in FILES]
)
def test_there_is_one_assignment_a_line(package, file):
    assert not list(packed(ast.parse(file.read_text()))), "one statement a line: no tuple that packs several values"


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("a, b = 1, c", True),
        ("a, b = f(c), (1, 2) if d else (3, 4)", True),
        ("a, b = c, d.e", False),
        ("a, b = b, a + b", False),
        ("a, b = f(c)", False),
        ("a = 1, 2", False),
        ("a, *b = 1, 2", False),
    ],
)
def test_a_packed_assignment_is_seen(line, found):
    assert bool(list(packed(ast.parse(line)))) == found
