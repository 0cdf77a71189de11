"""Functional Mock-up Units, plants from other tools, as blocks."""

import dataclasses
import functools
import hashlib
import io
import math
import re
import shutil
import xml.parsers.expat as expat
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from jaxtyping import Float

from motorgrad._errors import NotTrusted, check, choice, shown, unknown
from motorgrad._limits import MAX_FMU_BYTES, MAX_FMU_DESCRIPTION_BYTES
from motorgrad._reading import content_of, entries_in, error_message, unpacked
from motorgrad.schema import count, static
from timlab.blocks._base import as_text, read_table
from timlab.blocks.worlds._fmu_instance import CoSimulation, Instance, ModelExchange, fmpy_module
from timlab.diagram import Foreign, Host, HostBlock, HostMoment, Port, Ports, nested

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ModelVariable  # pyright: ignore[reportMissingImports]

SIGNAL_KINDS = {
    "Real": "float",
    "Float64": "float",
    "Float32": "float",
    "Integer": "int",
    "Int32": "int",
    "Boolean": "bool",
}
SIGNAL_KINDS |= {"Enumeration": "int", "Int8": "int", "Int16": "int", "UInt8": "int", "UInt16": "int"}


class FmuHost(Host):
    """One instance of the unit per seed, of the `content` of its file."""

    def __init__(self, block: "Fmu", content: bytes, seeds: int):
        fmpy = fmpy_module()
        self._ports_in = block.variables("input")
        self._ports_out = block.variables("output")
        self._folder = str(fmpy.extract(io.BytesIO(content)))
        kind = CoSimulation if block.uses_co_simulation else ModelExchange
        start = [(block.unit_variables[name], value) for name, value in block.starts.items()]
        self._instances: list[Instance] = []
        try:
            for _ in range(seeds):
                self._instances.append(kind(block.unit, self._folder, start, block.substeps))
        except BaseException:
            self.close()
            raise
        self._read()

    def output(self, block: HostBlock, inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        return self._outputs

    def update(self, block: HostBlock, inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        for n, instance in enumerate(self._instances):
            given = [(variable, inputs[name][n]) for name, variable in self._ports_in.items()]
            instance.step(given, now.time, now.step)
        self._read()

    def snapshot(self) -> dict[str, np.ndarray]:
        states = [np.frombuffer(instance.saved(), np.uint8) for instance in self._instances]
        size = max(map(len, states))
        found = {f"output {name}": value.copy() for name, value in self._outputs.items()}
        found["state"] = np.stack([np.pad(state, (0, size - len(state))) for state in states])
        found["size"] = np.array([len(state) for state in states])
        found["next event"] = np.array([instance.next_event for instance in self._instances])
        return found

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        fits = "state" in snapshot and len(snapshot["state"]) == len(self._instances)
        check(fits, "snapshot", sorted(snapshot), "a snapshot of this block with as many seeds")
        for n, instance in enumerate(self._instances):
            state = np.asarray(snapshot["state"][n], np.uint8)[: int(snapshot["size"][n])]
            instance.restore(state.tobytes(), float(snapshot["next event"][n]))
        self._outputs = {name: np.array(snapshot[f"output {name}"]) for name in self._outputs}

    def close(self) -> None:
        for instance in self._instances:
            instance.close()
        self._instances = []
        shutil.rmtree(self._folder, ignore_errors=True)

    def _read(self) -> None:
        rows = [instance.read(list(self._ports_out.values())) for instance in self._instances]
        self._outputs = {name: np.stack([row[n] for row in rows]) for n, name in enumerate(self._ports_out)}


@dataclasses.dataclass(frozen=True)
class Fmu(Foreign, HostBlock):
    """A Functional Mock-up Unit of version 2.0 or 3.0: a model that another tool has exported, for co-simulation or for
    model exchange. Its inputs and outputs are ports; in their names, all but letters, digits and `_` becomes `_`.

    At each of its ticks the unit takes its inputs and advances to the next. So its outputs do not depend on the inputs
    of the same tick. A unit for model exchange is integrated by RK4; where an event indicator changes its sign, the
    place is found by bisection. Units of all seeds are separate instances.

    A run can go back in time where the unit can save its state (`canGetAndSetFMUstate` and `canSerializeFMUstate`). A
    unit is a compiled program: that of a stranger's diagram does not run before you trust it, nor after its file was
    exchanged. It needs the extra `fmi`.
    """

    name: ClassVar[str] = "fmu"
    category: ClassVar[str] = "bodies and worlds"
    brings: ClassVar[str] = "file"

    file: str = static(help="path of the unit (.fmu), relative to the working folder")
    interface: Literal["", "co-simulation", "model exchange"] = static(
        "", help="how the unit is run; empty for co-simulation where the unit has it"
    )
    start_values: str | Mapping[str, Any] = static(
        "", help="start values of parameters and other variables as TOML: `mass = 2.0`"
    )
    substeps: int = count(10, 1, 100_000, help="integration steps per tick of a unit for model exchange")

    def validate(self) -> None:
        object.__setattr__(self, "start_values", as_text("start_values", self.start_values))
        self._meet()
        for name, value in self.starts.items():
            if name not in self.unit_variables:
                raise unknown("variable of the unit", name, self.unit_variables)
            size = math.prod(self.unit_variables[name].shape or ())
            numbers = len(_elements(value))
            check(numbers in (1, size), name, value, f"one value at the start, or {size}")
        if self.interface:
            kinds = {"co-simulation": self.unit.coSimulation, "model exchange": self.unit.modelExchange}
            choice("interface of the unit", self.interface, [name for name, each in kinds.items() if each is not None])
        try:
            for causality in ("input", "output"):
                for variable in self.variables(causality).values():
                    check(
                        variable.type in SIGNAL_KINDS,
                        variable.name,
                        variable.type,
                        f"of a type among {', '.join(SIGNAL_KINDS)}",
                    )
        except ValueError as error:
            raise ValueError(f"file = {self.file!r}: {error}") from None

    @property
    def code(self) -> str:
        return f"{Path(self.file).absolute()}\nSHA-256 {self.key}"

    @property
    def key(self) -> str:
        return self._read[0]

    @property
    def unit(self) -> Any:
        """The unit's description, as fmpy reads it."""
        return self._read[1]

    @functools.cached_property
    def _read(self) -> tuple[str, Any]:
        """The hash of the unit and its description, of the same bytes."""
        fmpy = fmpy_module()
        content = self._content()
        try:
            _check_unpacked(content)
            found = fmpy.read_model_description(io.BytesIO(content), validate=False)
        except Exception as error:  # it raises whatever a damaged archive or XML makes it raise
            raise ValueError(
                f"file = {self.file!r}: is not a Functional Mock-up Unit: {error_message(error)}"
            ) from None
        try:
            _check_description(found)
        except ValueError as error:
            raise ValueError(f"file = {self.file!r}: {error}") from None
        return hashlib.sha256(content).hexdigest(), found

    def _content(self) -> bytes:
        """What the file holds now."""
        file = Path(self.file)
        check(file.suffix == ".fmu" and file.is_file(), "file", self.file, "a path of a file that ends in .fmu")
        try:
            return content_of(file, MAX_FMU_BYTES)
        except ValueError as error:
            raise ValueError(f"file = {self.file!r}: {error}") from None

    @functools.cached_property
    def unit_variables(self) -> dict[str, Any]:
        """All variables of the unit by name."""
        return {variable.name: variable for variable in self.unit.modelVariables}

    @property
    def starts(self) -> dict[str, Any]:
        """The given start values, by the names of variables."""
        return read_table("start_values", self.start_values)

    @property
    def uses_co_simulation(self) -> bool:
        """Whether the unit makes its steps itself."""
        return self.interface != "model exchange" and self.unit.coSimulation is not None

    def variables(self, causality: str) -> dict[str, Any]:
        """The unit's inputs or outputs, by the names of ports."""
        found: dict[str, Any] = {}
        for variable in self.unit.modelVariables:
            if variable.causality == causality:
                name = re.sub(r"\W+", "_", variable.name).strip("_") or "_"
                check(
                    name not in found, "name of a variable", variable.name, "different from others as a name of a port"
                )
                found[name] = variable
        return found

    @property
    def inputs(self) -> Ports:
        return self._ports["input"]

    @property
    def outputs(self) -> Ports:
        return self._ports["output"]

    @functools.cached_property
    def _ports(self) -> dict[str, Ports]:  # read at every tick
        given = self.starts
        return {
            causality: {
                name: _port(each, given.get(each.name, each.start), causality == "input")
                for name, each in self.variables(causality).items()
            }
            for causality in ("input", "output")
        }

    @property
    def no_restore(self) -> str | None:
        unit = self.unit.coSimulation if self.uses_co_simulation else self.unit.modelExchange
        if unit.canGetAndSetFMUstate and unit.canSerializeFMUstate:
            return None
        return f"the unit {Path(self.file).name} cannot save its state"

    def start(self, seeds: np.ndarray, uniforms: Float[np.ndarray, "seeds 0"], threads: int = 0) -> FmuHost:
        self.check_trusted()
        content = self._content()
        if hashlib.sha256(content).hexdigest() != self.key:
            raise NotTrusted(
                f"{Path(self.file).absolute()} is not the unit that was read when this block was made: nothing of it "
                "was run. Open the diagram again, or make the block again, to run the new one"
            )
        unit = self.unit.coSimulation if self.uses_co_simulation else self.unit.modelExchange
        check(
            len(seeds) == 1 or not unit.canBeInstantiatedOnlyOncePerProcess,
            "seeds",
            len(seeds),
            "1: the unit allows no more",
        )
        return FmuHost(self, content, len(seeds))


def _check_unpacked(content: bytes) -> None:
    """Refuse a unit that unpacks to too much, and documents in it that declare their own entities, which expand."""

    def refuse(name: str, *_: object) -> None:
        raise ValueError(f"document type {name!r}: must be none")

    with entries_in(content, MAX_FMU_BYTES) as packed:
        for name in packed.namelist():
            if name.lower().endswith(".xml"):
                parser = expat.ParserCreate()
                parser.StartDoctypeDeclHandler = refuse
                parser.Parse(unpacked(packed, name, MAX_FMU_DESCRIPTION_BYTES), True)


def _check_description(unit: "ModelDescription") -> None:
    """Refuse a unit whose description lacks what running it needs, or whose inputs start with no numbers."""
    choice("version of the unit", str(unit.fmiVersion).partition("-")[0], ("2.0", "3.0"))
    interfaces = [each for each in (unit.coSimulation, unit.modelExchange) if each is not None]
    check(interfaces, "interfaces of the unit", [], "co-simulation or model exchange")
    for each in interfaces:
        name = each.modelIdentifier
        inside = name and re.fullmatch(r"[\w.-]+", name)  # else it could name a library that was not read
        check(inside, "modelIdentifier of the unit", name, "the name of a library in the unit")
    for variable in unit.modelVariables:
        check(variable.name, "name of a variable", variable.name, "a text")
        if variable.causality == "input":
            _port(variable, variable.start, True)


def _port(variable: "ModelVariable", start: object, is_input: bool) -> Port:
    """The port of a variable, with its start value, if any."""
    kind: Any = SIGNAL_KINDS.get(variable.type, "float")
    shape = tuple(int(size) for size in variable.shape or ())
    return Port(
        shape,
        kind,
        feedthrough=not is_input,
        default=_default(variable.name, start, shape) if is_input else None,
        help=variable.description or "",
        unit=variable.unit or "",
    )


def _default(name: str, start: object, shape: tuple[int, ...]) -> Any:
    """What an input is where no wire leads to it: its start value, as a unit's description says it, or one that is
    given; 0 without any.
    """
    words = start.split() if isinstance(start, str) else _elements([] if start is None else start)
    truths = {"true": 1.0, "false": 0.0}
    try:
        numbers = np.array([truths[word] if word in truths else float(word) for word in words or [0.0]])
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {shown(start)}: must be a number at the start, or one for each element") from None
    check(np.isfinite(numbers).all(), name, start, "finite at the start")
    size = math.prod(shape)
    check(numbers.size in (1, size), name, start, f"one number at the start, or {size}")
    return nested((numbers.reshape(shape) if numbers.size == size else numbers[0]).tolist())


def _elements(value: object) -> list[Any]:
    """The elements of nested lists, or a single value, as one list."""
    return [each for part in value for each in _elements(part)] if isinstance(value, list) else [value]
