"""A program as the statements of a C function."""

import re
from collections.abc import Callable, Sequence

import numpy as np

from motorgrad._errors import check
from motorgrad.export._c_numbers import CFile, limit, literal, type_of
from motorgrad.export._program import Operation, Program, Untranslatable

INFIX = {
    **{"add": "+", "sub": "-", "mul": "*", "div": "/", "and": "&", "or": "|", "xor": "^"},
    **{"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="},
    **{"shift_left": "<<", "shift_right_arithmetic": ">>"},
}
FUNCTIONS = {
    **{"abs": "fabs", "pow": "pow", "rem": "fmod", "atan2": "atan2"},
    **{name: name for name in ["floor", "ceil", "exp", "expm1", "log", "log1p", "sqrt", "sin", "cos", "tan"]},
    **{name: name for name in ["asin", "acos", "atan", "sinh", "cosh", "tanh", "erf", "erfc", "lgamma", "rint"]},
}
MAX_EXPRESSION_OPERATIONS = 12
STARTS = {"sum": "0", "prod": "1", "any": "false", "all": "true"}
IDENTIFIER = re.compile(r"[A-Za-z_]\w*")


class CFunction:
    """One program as statements. Arrays that are used once, and known rearrangements of others, are not stored: their
    elements are written where they are needed."""

    def __init__(self, file: CFile, program: Program):
        self.file, self.program, self.operations = file, program, program.operations
        self._names: dict[int, str] = {place: name for name, place in program.inputs.items()}
        self._lines: list[str] = []
        self._weights: dict[int, int] = {}
        self._stored = self._to_store()

    def text(self, name: str) -> str:
        inputs, outputs = self.program.inputs, self.program.outputs
        given = [self._parameter(each, place, each not in outputs) for each, place in inputs.items()]
        given += [self._parameter(each, place, False) for each, place in outputs.items() if each not in inputs]
        for place, operation in enumerate(self.operations):
            if place in self._stored and operation.kind not in ("input", "constant"):
                self._store(place)
        for each, place in sorted(outputs.items(), key=lambda item: item[0] in inputs):  # those in place come last
            self._loop(
                self.operations[place].shape,
                lambda at, each=each, place=place: [
                    f"{each}[{self._flat(self.operations[place].shape, at)}] = {self._at(place, at)};"
                ],
            )
        body = "\n".join(f"    {line}" for line in self._lines)
        return f"void {name}({', '.join(given) or 'void'})\n{{\n{body}\n}}\n"

    def _parameter(self, name: str, place: int, constant: bool) -> str:
        check(IDENTIFIER.fullmatch(name), "name", name, "letters, digits and _, as in C")
        operation = self.operations[place]
        return f"{'const ' * constant}{type_of(operation.dtype)} {name}[{max(1, _size(operation))}]"

    def _to_store(self) -> set[int]:
        """The arrays that are computed once and kept: those used more than once, or in loops of their own."""
        uses = [0] * len(self.operations)
        stored = set()
        for operation in self.operations:
            for place in operation.operands:
                uses[place] += 1
        for name, place in self.program.outputs.items():
            uses[place] += 1
            if name in self.program.inputs:
                stored.add(place)
        for place, operation in enumerate(self.operations):
            kind = operation.kind
            loops = kind in ("concatenate", "einsum", "argmax", "argmin") or kind.split()[0] in ("reduce", "cumulative")
            if kind in ("input", "constant") or loops:
                stored.add(place)
            if (
                kind in ("take", "einsum")
                or kind.startswith("cumulative")
                or (kind == "reshape" and not self._thin(place))
            ):
                stored |= set(operation.operands)
            if kind == "pick":
                stored.add(operation.operands[0])
            smaller = [each for each in operation.operands if _size(self.operations[each]) < _size(operation)]
            stored |= {each for each in smaller if not self._view(each)}
        for place, operation in enumerate(self.operations):
            if uses[place] > 1 and not self._view(place):
                stored.add(place)
            weight = sum(self._weights[each] for each in operation.operands if each not in stored)
            self._weights[place] = weight + (not self._view(place))
            if self._weights[place] > MAX_EXPRESSION_OPERATIONS:
                stored.add(place)
        return stored

    def _view(self, place: int) -> bool:
        """Whether an array only shows the elements of others that are stored."""
        operation = self.operations[place]
        if operation.kind in ("reshape", "expand"):
            return self._view(operation.operands[0])
        return operation.kind in ("input", "constant", "take")

    def _thin(self, place: int) -> bool:
        """Whether a reshape only adds or removes axes of length 1."""
        operation = self.operations[place]
        inner = self.operations[operation.operands[0]].shape
        return [n for n in operation.shape if n > 1] == [n for n in inner if n > 1]

    def _name(self, place: int) -> str:
        return self._names.setdefault(place, f"v{place}")

    def _store(self, place: int) -> None:
        """Compute an array and keep it."""
        operation = self.operations[place]
        name = self._name(place)
        single = _size(operation) == 1
        kind, _, which = operation.kind.partition(" ")
        declared = f"{type_of(operation.dtype)} {name}" + ("" if single else f"[{_size(operation)}]")
        own = {"concatenate": self._concatenate, "einsum": self._einsum, "argmax": self._arg, "argmin": self._arg}
        if single and kind not in (*own, "reduce", "cumulative"):
            self._lines.append(f"const {declared} = {self._at(place, ('0',) * len(operation.shape), inside=True)};")
            return
        self._lines.append(f"{declared};")
        if kind in own:
            own[kind](place)
        elif kind == "reduce":
            self._reduce(place, which)
        elif kind == "cumulative":
            self._cumulative(place, which)
        else:
            self._loop(
                operation.shape, lambda at: [f"{self._element(place, at)} = {self._at(place, at, inside=True)};"]
            )

    def _concatenate(self, place: int) -> None:
        operation = self.operations[place]
        start = 0
        axis = operation.attributes["axis"]
        for part in operation.operands:
            shape = self.operations[part].shape

            def body(at: tuple[str, ...], part: int = part, start: int = start) -> list[str]:
                there = list(at)
                there[axis] = str(start) if at[axis] == "0" else f"({at[axis]} + {start})" if start else at[axis]
                return [f"{self._element(place, tuple(there))} = {self._at(part, at)};"]

            self._loop(shape, body)
            start += shape[axis]

    def _einsum(self, place: int) -> None:
        operation = self.operations[place]
        given, made = operation.attributes["spec"].split("->")
        left, right = given.split(",")
        first, second = operation.operands
        sizes = dict(zip(left + right, self.operations[first].shape + self.operations[second].shape, strict=True))
        summed = [letter for letter in dict.fromkeys(left + right) if letter not in made]

        def body(at: tuple[str, ...]) -> list[str]:
            where = dict(zip(made, at, strict=True))

            def term(inner: tuple[str, ...]) -> list[str]:
                there = where | dict(zip(summed, inner, strict=True))
                parts = ((first, left), (second, right))
                factors = [self._at(part, tuple(there[each] for each in letters)) for part, letters in parts]
                return [f"sum += {' * '.join(factors)};"]

            lines = self._looped([sizes[letter] for letter in summed], term, "j")
            return [f"{type_of(operation.dtype)} sum = 0;", *lines, f"{self._element(place, at)} = sum;"]

        self._loop(operation.shape, body)

    def _reduce(self, place: int, which: str) -> None:
        operation = self.operations[place]
        (inner,) = operation.operands
        axes = operation.attributes["axes"]
        shape = self.operations[inner].shape
        extreme = which in ("max", "min")
        start = STARTS.get(which) or limit(operation.dtype, which)

        def body(at: tuple[str, ...]) -> list[str]:
            def term(reduced: tuple[str, ...]) -> list[str]:
                outer = iter(at)
                own = iter(reduced)
                value = self._at(inner, tuple(next(own) if axis in axes else next(outer) for axis in range(len(shape))))
                if extreme:
                    return [f"all = {self.file.helper(which, operation.dtype)}(all, {value});"]
                sign = {"sum": "+", "prod": "*", "any": "|", "all": "&"}[which]
                return [f"all {sign}= {value};"]

            lines = self._looped([shape[axis] for axis in range(len(shape)) if axis in axes], term, "j")
            return [f"{type_of(operation.dtype)} all = {start};", *lines, f"{self._element(place, at)} = all;"]

        self._loop(operation.shape, body)

    def _arg(self, place: int) -> None:
        operation = self.operations[place]
        (inner,) = operation.operands
        axis = operation.attributes["axis"]
        shape = self.operations[inner].shape
        sign = ">" if operation.kind == "argmax" else "<"

        def body(at: tuple[str, ...]) -> list[str]:
            def value(where: str) -> str:
                return self._at(inner, (*at[:axis], where, *at[axis:]))

            kind = type_of(self.operations[inner].dtype)
            better = f"if (here {sign} best || (here != here && best == best)) {{ best = here; place = j; }}"
            loop = f"for (int j = 1; j < {shape[axis]}; ++j) {{ const {kind} here = {value('j')}; {better} }}"
            return [f"int place = 0; {kind} best = {value('0')};", loop, f"{self._element(place, at)} = place;"]

        self._loop(operation.shape, body)

    def _cumulative(self, place: int, which: str) -> None:
        operation = self.operations[place]
        (inner,) = operation.operands
        axis = operation.attributes["axis"]
        shape = operation.shape

        def body(at: tuple[str, ...]) -> list[str]:
            def of(part: int, where: str) -> str:
                there = (*at[:axis], where, *at[axis:])
                return self._element(place, there) if part == place else self._at(part, there)

            both = (of(place, "(j - 1)"), of(inner, "j"))
            if which in ("max", "min"):
                joined = f"{self.file.helper(which, operation.dtype)}({both[0]}, {both[1]})"
            else:
                joined = f" {'+' if which == 'sum' else '*'} ".join(both)
            loop = f"for (int j = 1; j < {shape[axis]}; ++j) {of(place, 'j')} = {joined};"
            return [f"{of(place, '0')} = {of(inner, '0')};", loop]

        self._loop((*shape[:axis], *shape[axis + 1 :]), body)

    def _loop(self, shape: Sequence[int], body: Callable[[tuple[str, ...]], list[str]]) -> None:
        self._lines += self._looped(shape, body, "i")

    def _looped(self, shape: Sequence[int], body: Callable[[tuple[str, ...]], list[str]], letter: str) -> list[str]:
        """Nested loops around statements that `body` makes of the coordinates."""
        if 0 in shape:
            return []
        at = tuple("0" if size == 1 else f"{letter}{axis}" for axis, size in enumerate(shape))
        loops = [f"for (int {i} = 0; {i} < {n}; ++{i})" for i, n in zip(at, shape, strict=True) if n > 1]
        inner = body(at)
        if not loops and letter == "j":
            return inner
        opened = " ".join([*loops, "{"]) if len(inner) > 1 else " ".join(loops)
        if len(inner) == 1:
            return [f"{opened} {inner[0]}".strip()]
        return [opened, *(f"    {line}" for line in inner), "}"]

    def _element(self, place: int, at: tuple[str, ...]) -> str:
        """An element of a stored array."""
        return self._leaf(place, self._flat(self.operations[place].shape, at))

    def _leaf(self, place: int, index: str) -> str:
        operation = self.operations[place]
        if operation.kind == "constant":
            value = operation.attributes["value"]
            return literal(value.flat[0]) if value.size == 1 else f"{self.file.table(value)}[{index}]"
        single = _size(operation) == 1 and operation.kind != "input"
        return self._name(place) if single else f"{self._name(place)}[{index}]"

    def _flat(self, shape: Sequence[int], at: Sequence[str]) -> str:
        """The place in the flat array."""
        strides = [int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))]
        terms = [i if n == 1 else f"{i} * {n}" for i, n in zip(at, strides, strict=True) if i != "0"]
        return " + ".join(terms) or "0"

    def _at(self, place: int, at: tuple[str, ...], inside: bool = False) -> str:
        """The expression of an element. `inside` its own statement, a stored array is computed."""
        operation = self.operations[place]
        if place in self._stored and not inside:
            return self._element(place, at)
        kind, operands = operation.kind, operation.operands
        if kind == "reshape":
            if not self._thin(place):
                return self._leaf(operands[0], self._flat(operation.shape, at))
            wide = iter(i for i, size in zip(at, operation.shape, strict=True) if size > 1)
            return self._at(
                operands[0], tuple(next(wide) if n > 1 else "0" for n in self.operations[operands[0]].shape)
            )
        if kind == "expand":
            return self._at(operands[0], self._there(operands[0], at))
        if kind == "take":
            return self._leaf(operands[0], self._taken(operation, at))
        if kind == "pick":
            return self._leaf(operands[0], self._at(operands[1], at))
        return self._elementwise(operation, [self._at(each, self._there(each, at)) for each in operands])

    def _there(self, place: int, at: tuple[str, ...]) -> tuple[str, ...]:
        """The coordinates in an array that is repeated along its axes of length 1, or is a number."""
        shape = self.operations[place].shape
        return tuple("0" if n == 1 else i for i, n in zip(at, shape, strict=True)) if shape else ()

    def _taken(self, operation: Operation, at: tuple[str, ...]) -> str:
        """The place of an element that is taken: a sum of coordinates where that is possible, else from a table."""
        index = operation.attributes["index"]
        if index.size == 0:
            return "0"
        start = int(index.flat[0])
        strides = [
            int(np.moveaxis(index, axis, 0)[1].flat[0]) - start if n > 1 else 0 for axis, n in enumerate(index.shape)
        ]
        places = np.indices(index.shape)
        if np.array_equal(index, start + sum(n * i for n, i in zip(strides, places, strict=True))):
            terms = [i if n == 1 else f"{i} * {n}" for i, n in zip(at, strides, strict=True) if n]
            return " + ".join([*terms, *([str(start)] if start or not terms else [])])
        return f"{self.file.table(index)}[{self._flat(index.shape, at)}]"

    def _elementwise(self, operation: Operation, given: list[str]) -> str:
        kind = operation.kind
        dtype = operation.dtype
        real = operation.dtype.kind == "f"
        of = self.operations[operation.operands[0]].dtype
        if kind in INFIX:
            return f"({given[0]} {INFIX[kind]} {given[1]})"
        if kind == "select":
            return f"({given[0]} ? {given[1]} : {given[2]})"
        if kind == "neg":
            return f"(-{given[0]})"
        if kind == "not":
            return f"(!{given[0]})" if dtype.kind == "b" else f"(~{given[0]})"
        if kind == "convert":
            return f"({given[0]} != 0)" if dtype.kind == "b" else f"(({type_of(dtype)}){given[0]})"
        if kind == "is_finite":
            return f"(isfinite({given[0]}) != 0)"
        if kind == "shift_right_logical":
            unsigned = type_of(np.dtype(f"u{dtype.itemsize}"))
            return f"(({type_of(dtype)})(({unsigned}){given[0]} >> {given[1]}))"
        if kind in ("max", "min", "sign"):
            return f"{self.file.helper(kind, dtype)}({', '.join(given)})"
        if kind == "bitcast":
            return f"{self.file.helper(kind, dtype, of)}({given[0]})"
        if not real and kind in ("rem", "abs"):
            return f"({given[0]} % {given[1]})" if kind == "rem" else f"({given[0]} < 0 ? -{given[0]} : {given[0]})"
        if real and kind in FUNCTIONS:
            return f"{FUNCTIONS[kind]}{'f' * (dtype.itemsize == 4)}({', '.join(given)})"
        raise Untranslatable(f"{kind}: has no form in C for {dtype} numbers")


def _size(operation: Operation) -> int:
    return int(np.prod(operation.shape))
