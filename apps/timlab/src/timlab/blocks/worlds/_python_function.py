"""A Python function as a block."""

import dataclasses
import math
import traceback
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad._limits import MAX_FUNCTION_CHARACTERS
from motorgrad.schema import static
from timlab.blocks._base import check_names
from timlab.diagram import Foreign, Host, HostBlock, HostMoment, Port, Ports, is_from_a_file

FILE = "<python function>"
SOURCE = """def start():
    return {"total": 0.0}


def step(u, memory, time):
    memory["total"] += u
    return memory["total"]
"""


class PythonHost(Host):
    """The function's two parts, and a memory for each seed."""

    def __init__(self, block: "PythonFunction", seeds: int):
        self._gives = [(name, shape) for name, shape in zip(block.gives, block.gives_shapes, strict=True)]
        self._takes = block.takes
        names: dict[str, Any] = {"np": np, "math": math, "__name__": "python_function"}
        self._call(exec, block.compiled(), names)
        self._step = names.get("step")
        check(callable(self._step), "source", sorted(set(names) - {"__builtins__"}), "Python with a function step")
        start = names.get("start")
        self._memories = [dict(self._call(start)) if callable(start) else {} for _ in range(seeds)]

    def output(self, block: HostBlock, inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        assert self._step is not None
        rows = []
        for n, memory in enumerate(self._memories):
            given = [inputs[name][n] for name in self._takes]
            made = self._call(self._step, *(x.item() if x.ndim == 0 else x for x in given), memory, now.time)
            parts = made if len(self._gives) != 1 else (made,)
            right = isinstance(parts, tuple | list) and len(parts) == len(self._gives)
            check(right, "step", made, f"a function that returns {len(self._gives)} values")
            rows.append([self._shaped(x, *port) for x, port in zip(parts, self._gives, strict=True)])
        return {name: np.stack([row[k] for row in rows]) for k, (name, _) in enumerate(self._gives)}

    def update(self, block: HostBlock, inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        """Nothing: the memory changed when the outputs were computed."""

    def snapshot(self) -> dict[str, np.ndarray]:
        names = self._memories[0].keys()
        try:
            found = {name: np.stack([np.asarray(memory[name]) for memory in self._memories]) for name in names}
        except (KeyError, ValueError) as error:
            raise ValueError(f"memory: must have the same names and shapes in all seeds: {error}") from None
        for name, values in found.items():
            check(
                values.dtype.kind in "biuf",
                f"memory[{name!r}]",
                self._memories[0][name],
                "numbers or arrays of numbers",
            )
        return found

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        def plain(value: np.ndarray) -> Any:
            return value.item() if value.ndim == 0 else value.copy()

        self._memories = [
            {name: plain(np.asarray(values)[n]) for name, values in snapshot.items()}
            for n in range(len(self._memories))
        ]

    def _shaped(self, value: object, name: str, shape: tuple[int, ...]) -> np.ndarray:
        try:
            array = np.asarray(value, float)
        except (TypeError, ValueError):
            array = None
        check(array is not None and array.shape == shape, name, value, f"numbers of shape {shape}")
        return np.asarray(array)

    def _call(self, function: Callable[..., Any], *arguments: object) -> Any:
        """Call the user's code; an error names its line."""
        try:
            return function(*arguments)
        except Exception as error:
            lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == FILE]
            where = f", line {lines[-1]}" if lines else ""
            raise RuntimeError(f"python function{where}: {type(error).__name__}: {error}") from error


@dataclasses.dataclass(frozen=True)
class PythonFunction(Foreign, HostBlock):
    """A function in Python, called once at each of the block's ticks, for every seed: `step(u, memory, time)`, with the
    inputs in their order, a dictionary that it may change, and the seconds since the start. It returns the output, or
    several.

    `np` and `math` are known. An optional function `start()` returns the memory before the first tick; it holds numbers
    and arrays that keep their shapes, so that a run can go back in time. The function must depend on these alone: take
    chance from a noise block.

    It runs on the host, and is slow beside compiled blocks: use `Expression` for formulas, and a class of your own for
    the rest. The source is saved in the diagram's file. That of a stranger's file does not run before you trust it.
    """

    name: ClassVar[str] = "python function"
    category: ClassVar[str] = "mathematics"
    brings: ClassVar[str] = "source"

    source: str = static(SOURCE, help="Python with a function step")
    takes: tuple[str, ...] = static(("u",), help="names of the inputs")
    gives: tuple[str, ...] = static(("y",), help="names of the outputs")
    takes_shapes: tuple[tuple[int, ...], ...] = static((), help="shapes of the inputs; empty for single numbers")
    gives_shapes: tuple[tuple[int, ...], ...] = static((), help="shapes of the outputs; empty for single numbers")

    def validate(self) -> None:
        check(
            len(self.source) <= MAX_FUNCTION_CHARACTERS,
            "source",
            f"{len(self.source)} characters",
            f"at most {MAX_FUNCTION_CHARACTERS:,} characters",
        )
        check_names("takes", self.takes)
        check_names("gives", self.gives, least=1)
        for names, shapes in (("takes", "takes_shapes"), ("gives", "gives_shapes")):
            count = len(getattr(self, names))
            given = getattr(self, shapes)
            check(len(given) in (0, count), shapes, given, f"empty, or {count} shapes")
            object.__setattr__(self, shapes, given or ((),) * count)
        self._meet()
        if not is_from_a_file():
            self.compiled()

    def compiled(self) -> Any:
        """The source as Python's code. **Raises** `ValueError` that names the line of an error."""
        try:
            return compile(self.source, FILE, "exec")
        except (SyntaxError, ValueError) as error:
            raise ValueError(f"source: line {getattr(error, 'lineno', None) or 1}: {error.args[0]}") from None

    @property
    def code(self) -> str:
        return self.source

    @property
    def inputs(self) -> Ports:
        return {name: Port(shape) for name, shape in zip(self.takes, self.takes_shapes, strict=True)}

    @property
    def outputs(self) -> Ports:
        return {name: Port(shape) for name, shape in zip(self.gives, self.gives_shapes, strict=True)}

    def start(self, seeds: np.ndarray, uniforms: Float[np.ndarray, "seeds 0"], threads: int = 0) -> PythonHost:
        self.check_trusted()
        return PythonHost(self, len(seeds))
