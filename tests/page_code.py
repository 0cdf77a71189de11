"""What the Python code of a page of the documentation uses, found without running it.

Imports are made. Of every other name the code tells where it comes from: `mg.train` is an attribute of an imported
module, and `run` in `run = mg.train(...)` is what that function returns. So it can be said of most names and calls
whether motorgrad and its applications have them, and whether they take what they are given.
"""

import ast
import builtins
import dataclasses
import functools
import importlib
import inspect
import typing
from typing import Any

import needed
from motorgrad.schema import fields_of
from motorgrad.tasks import TASKS, make


@dataclasses.dataclass(frozen=True)
class Known:
    """A module, class or function."""

    value: Any


@dataclasses.dataclass(frozen=True)
class Instance:
    """Something of a class, and no more is known of it."""

    cls: type


@dataclasses.dataclass(frozen=True)
class Method:
    """A function of a class, taken from an instance."""

    function: Any


Found = Known | Instance | Method | None

PACKAGES = ("motorgrad", "timsim", "timlab", "motorgrad_thesis")
"""What a page is held to; of other packages only imports are checked."""


class PageCode(ast.NodeVisitor):
    """Reads the blocks of a page in order; `faults` grows with what there is not, a line for each."""

    def __init__(self) -> None:
        self.names: dict[str, Found] = {"__name__": None}
        self.faults: list[str] = []
        self.checked = 0

    def read(self, code: str, name: str) -> None:
        tree = ast.parse(code, name)
        compile(tree, name, "exec")
        for statement in tree.body:
            self.visit(statement)

    def fault(self, node: ast.AST, said: str) -> None:
        self.faults.append(f"line {getattr(node, 'lineno', 0)}, {ast.unparse(node)}: {said}")

    # ---- statements that give names

    def visit_Import(self, node: ast.Import) -> None:
        for alias in node.names:
            module = self.imported(node, alias.name)
            top = alias.name.partition(".")[0]
            if alias.asname is None and module is not None:
                module = Known(importlib.import_module(top))
            self.names[alias.asname or top] = module

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        module = self.imported(node, node.module or "")
        for alias in node.names:
            found = None
            if module is not None and hasattr(module.value, alias.name):
                found = Known(getattr(module.value, alias.name))
            elif module is not None:
                found = self.imported(node, f"{node.module}.{alias.name}")
            self.names[alias.asname or alias.name] = found

    def imported(self, node: ast.AST, name: str) -> Known | None:
        self.checked += 1
        try:
            return Known(importlib.import_module(name))
        except ImportError as error:
            if not needed.lacked_by(error):
                self.fault(node, str(error))
            return None

    def visit_Assign(self, node: ast.Assign) -> None:
        found = self.found(node.value)
        for target in node.targets:
            self.give(target, found)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        self.give(node.target, self.found(node.value) if node.value else None)

    def visit_For(self, node: ast.For) -> None:
        self.found(node.iter)
        self.give(node.target, None)
        for statement in (*node.body, *node.orelse):
            self.visit(statement)

    def visit_With(self, node: ast.With) -> None:
        for item in node.items:
            manager = self.found(item.context_expr)
            if item.optional_vars is not None:
                entered = getattr(manager.cls, "__enter__", None) if isinstance(manager, Instance) else None
                self.give(item.optional_vars, None if entered is None else returned(entered, manager))
        for statement in node.body:
            self.visit(statement)

    def visit_Try(self, node: ast.Try) -> None:
        """What is tried may be wrong, as the page then says."""
        before = list(self.faults)
        for statement in node.body:
            self.visit(statement)
        self.faults = before
        for handler in node.handlers:
            if handler.name is not None:
                self.names[handler.name] = None
        for statement in (*(each for handler in node.handlers for each in handler.body), *node.orelse, *node.finalbody):
            self.visit(statement)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for each in (*node.decorator_list, *node.args.defaults, *(d for d in node.args.kw_defaults if d)):
            self.found(each)
        outer = self.names
        self.names = {**outer, **dict.fromkeys(arguments_of(node.args))}
        for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
            kind = self.found(argument.annotation) if argument.annotation is not None else None
            if isinstance(kind, Known) and isinstance(kind.value, type):
                self.names[argument.arg] = Instance(kind.value)
        for statement in node.body:
            self.visit(statement)
        self.names = {**outer, node.name: None}

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for each in (*node.decorator_list, *node.bases, *(keyword.value for keyword in node.keywords)):
            self.found(each)
        outer, self.names = self.names, {**self.names}
        for statement in node.body:
            self.visit(statement)
        self.names = {**outer, node.name: None}

    def give(self, target: ast.expr, found: Found) -> None:
        if isinstance(target, ast.Name):
            self.names[target.id] = found
        elif isinstance(target, ast.Tuple | ast.List):
            for each in target.elts:
                self.give(each, None)
        elif isinstance(target, ast.Starred):
            self.give(target.value, None)
        else:
            self.found(target)

    # ---- expressions

    def visit_Name(self, node: ast.Name) -> None:
        self.found(node)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        self.found(node)

    def visit_Call(self, node: ast.Call) -> None:
        self.found(node)

    def visit_Lambda(self, node: ast.Lambda) -> None:
        outer = self.names
        self.names = {**outer, **dict.fromkeys(arguments_of(node.args))}
        self.found(node.body)
        self.names = outer

    def visit_comprehension(self, node: ast.comprehension) -> None:
        self.found(node.iter)
        self.give(node.target, None)
        for condition in node.ifs:
            self.found(condition)

    def of_comprehension(self, node: Any) -> None:
        outer, self.names = self.names, {**self.names}
        for generator in node.generators:
            self.visit(generator)
        for part in ("key", "value", "elt"):
            if hasattr(node, part):
                self.found(getattr(node, part))
        self.names = outer

    visit_ListComp = visit_SetComp = visit_DictComp = visit_GeneratorExp = of_comprehension

    def found(self, node: ast.expr) -> Found:
        """What an expression stands for, as far as is known."""
        if isinstance(node, ast.Name):
            if node.id not in self.names and not hasattr(builtins, node.id):
                self.fault(node, "no block before this line defines it")
            return self.names.get(node.id)
        if isinstance(node, ast.Attribute):
            return self.attribute(node, self.found(node.value))
        if isinstance(node, ast.Call):
            return self.call(node)
        if isinstance(node, ast.Lambda | ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp):
            self.visit(node)
        else:
            self.generic_visit(node)
        return None

    def attribute(self, node: ast.Attribute, owner: Found) -> Found:
        if isinstance(owner, Known):
            self.checked += ours(owner.value)
            if hasattr(owner.value, node.attr):
                return Known(getattr(owner.value, node.attr))
            if ours(owner.value) and not (isinstance(owner.value, type) and has(owner.value, node.attr)):
                self.fault(node, f"{owner.value!r} has no {node.attr!r}")
        elif isinstance(owner, Instance) and ours(owner.cls):
            self.checked += 1
            if not has(owner.cls, node.attr):
                self.fault(node, f"{owner.cls.__name__} has no {node.attr!r}")
            return of_instance(owner, node.attr)
        return None

    def call(self, node: ast.Call) -> Found:
        called = self.found(node.func)
        for each in (*node.args, *(keyword.value for keyword in node.keywords)):
            self.found(each.value if isinstance(each, ast.Starred) else each)
        target = called.function if isinstance(called, Method) else called.value if isinstance(called, Known) else None
        if target is None or not ours(target) or not callable(target):
            return None
        self.checked += 1
        if said := misfit(target, node, isinstance(called, Method)):
            self.fault(node, said)
        if target is make and node.args and isinstance(node.args[0], ast.Constant):
            return self.made_task(node, str(node.args[0].value))
        return Instance(target) if isinstance(target, type) else returned(target, None)

    def made_task(self, node: ast.Call, name: str) -> Found:
        """A task by its name, whose settings are keyword arguments."""
        if name not in TASKS:  # the page has registered it
            return None
        for keyword in node.keywords:
            if keyword.arg is not None and keyword.arg not in fields_of(TASKS[name]):
                self.fault(node, f"the task {name!r} has no setting {keyword.arg!r}")
        return Instance(TASKS[name])


def arguments_of(arguments: ast.arguments) -> list[str]:
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    every += [each for each in (arguments.vararg, arguments.kwarg) if each is not None]
    return [each.arg for each in every]


def ours(value: Any) -> bool:
    """Whether something is of our packages."""
    name = value.__name__ if inspect.ismodule(value) else getattr(value, "__module__", None)
    return str(name).partition(".")[0] in PACKAGES


def has(cls: type, name: str) -> bool:
    """Whether instances of a class, or of one derived from it, have an attribute."""
    if hasattr(cls, name) or hasattr(cls, "__getattr__"):
        return True
    for each in cls.__mro__:
        if name in inspect.get_annotations(each):
            return True
        if each is not object and f"self.{name} " in source_of(each).replace(":", " ").replace(",", " "):
            return True
    return any(has(each, name) for each in cls.__subclasses__())


@functools.cache
def source_of(cls: type) -> str:
    try:
        return inspect.getsource(cls)
    except (OSError, TypeError):
        return ""


def of_instance(owner: Instance, name: str) -> Found:
    """What an attribute of an instance is: a method, or of the class that an annotation tells."""
    try:
        found = inspect.getattr_static(owner.cls, name)
    except AttributeError:
        return of_hint(hints_of(owner.cls).get(name), owner)
    if isinstance(found, property | functools.cached_property):
        return returned(found.fget if isinstance(found, property) else found.func, owner)
    if inspect.isfunction(found):
        return Method(found)
    return Known(getattr(owner.cls, name)) if isinstance(found, staticmethod | classmethod) else None


def returned(function: Any, owner: Found) -> Found:
    """What a function returns."""
    return of_hint(hints_of(inspect.unwrap(function)).get("return"), owner)


def hints_of(annotated: Any) -> dict[str, Any]:
    try:
        return typing.get_type_hints(annotated)
    except (NameError, TypeError, AttributeError):  # a name that only a type checker imports
        return {}


def of_hint(hint: Any, owner: Found) -> Found:
    if hint is typing.Self:
        return owner
    return Instance(hint) if isinstance(hint, type) and not typing.get_args(hint) else None


def misfit(target: Any, node: ast.Call, bound: bool) -> str:
    """Why a function or class does not take these arguments; empty if it does."""
    if isinstance(target, type):
        if "__init__" not in dir(target) or target.__init__ is object.__init__:
            return ""
        target, bound = target.__init__, True
    try:
        signature = inspect.signature(target)
    except (TypeError, ValueError):
        return ""
    some = any(isinstance(each, ast.Starred) for each in node.args) or any(k.arg is None for k in node.keywords)
    values = [None] * (bound + sum(not isinstance(each, ast.Starred) for each in node.args))
    named = {keyword.arg: None for keyword in node.keywords if keyword.arg is not None}
    try:
        (signature.bind_partial if some else signature.bind)(*values, **named)
    except TypeError as error:
        return str(error)
    return ""
