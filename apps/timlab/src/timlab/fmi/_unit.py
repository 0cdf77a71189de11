"""Diagrams as Functional Mock-up Units."""

import hashlib
import io
import platform
import re
import shutil
import string
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from jax.typing import ArrayLike

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, choice
from motorgrad._files import check_writable, write_atomically
from motorgrad.export import Program, c_literal, c_source, c_type
from motorgrad.policies import Policy
from timlab.diagram import Diagram, Port
from timlab.engine import MAX_TICKS, Run
from timlab.fmi._policy import names_of, policy_diagram
from timlab.fmi._slopes import SlopeProgram, slope_program
from timlab.fmi._step import TickProgram, tick_program
from timlab.fmi._wrapper import wrapper

VERSIONS = ("2.0", "3.0")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-w")
CTYPES = {"float": "float", "int": "int32_t", "bool": "bool"}
C_KINDS = {"float": "REAL", "int": "INTEGER", "bool": "TRUTH"}
FMI_TYPES = {"2.0": ("Real", "Integer", "Boolean"), "3.0": ("Float64", "Int32", "Boolean")}
PLAIN = string.ascii_letters + string.digits + " .:()[],_-"  # characters that stand for themselves in a literal in C
EPOCH = (1980, 1, 1, 0, 0, 0)  # of the files in the unit, so that equal diagrams make equal units


def write_fmu(
    source: Diagram | Run | Policy,
    path: Path | str,
    version: str = "2.0",
    compiled: bool = True,
    interface: str = "co-simulation",
) -> Path:
    """Write a diagram as a Functional Mock-up Unit, which other simulators run.

    The unit's inputs are the inlets of the outermost diagram, its outputs the outlets.

    For co-simulation it makes one tick at a time: a communication step is a whole number of ticks. Its outputs belong
    to the time at the end of the step, and to the inputs that are set then. It has the same random numbers as the run,
    and its learners learn. Its state can be saved and restored. A step beyond tick 4,294,901,760 is an error; so are a
    start at another time than 0 s, from which ticks are counted, and a step that does not begin where the last ended.

    For model exchange it gives the time derivatives of the continuous states, in double precision, and the other
    simulator integrates them. The diagram has the precision `"double"` and nothing with memory but continuous states.

    **Arguments:**

    - `source`: a diagram, or a run of one seed: the unit then begins where the run is, with what it has learned; or the
      policy of a run of training, `mg.load(path).policy(seed)`: the unit's input is then the raw observation, its
      output the most probable raw action, its tick the period of decisions.
    - `path`: of the file, which ends in `.fmu`.
    - `version`: of the standard, `"2.0"` or `"3.0"`.
    - `compiled`: whether to compile it for this machine, with `cc`. The sources are always in it.
    - `interface`: `"co-simulation"` or `"model exchange"`.

    **Returns** the path.

    **Raises:** `ValueError` for a diagram with a block that cannot be exported; `RuntimeError` without a C compiler.

    ```python
    controller = timlab.extract(diagram, ["units"])
    timlab.write_fmu(controller, "controller.fmu")
    ```
    """
    check_arguments(write_fmu, locals())
    path = Path(path)
    check(path.suffix == ".fmu", "path", str(path), "a name that ends in .fmu")
    check_writable("path", path)
    choice("version", version, VERSIONS)
    choice("interface", interface, ("co-simulation", "model exchange"))
    exchanged = interface == "model exchange"
    known: dict[str, tuple[str, ...]] = {}
    if isinstance(source, Policy):
        check(not exchanged, "interface", interface, "'co-simulation' for a policy, which decides at intervals")
        known = names_of(source)
        source = policy_diagram(source)
    program: TickProgram | SlopeProgram = slope_program(source) if exchanged else tick_program(source)
    name = re.sub(r"\W|^(?=\d)", "_", path.stem, flags=re.ASCII)
    about = ["A diagram of motorgrad as a Functional Mock-up Unit."]
    functions = {"step": program.step}
    if isinstance(program, TickProgram):
        functions["outputs"] = program.outputs
    body = c_source(functions, "ode" if exchanged else "tick", about)
    guid = str(uuid.UUID(hashlib.sha256(f"{version}{program.inlets}{body}".encode()).hexdigest()[:32]))
    code = body + wrapper(version, guid, "slopes" if exchanged else "ticks", _parts(program))
    files: dict[str, bytes] = {
        "modelDescription.xml": _description(program, name, guid, version, known),
        f"sources/{name}.c": code.encode(),
    }
    if version == "3.0":
        files["sources/buildDescription.xml"] = _build_description(name)
    if compiled:
        files[_binary(name, version)] = _compiled(code)
    write_atomically(path, _zipped(files))
    return path


def _parts(program: TickProgram | SlopeProgram) -> dict[str, Any]:
    """What the C around the program needs to know of it."""
    exchanged = isinstance(program, SlopeProgram)
    states = len(program.states) if exchanged else 0
    types = CTYPES | ({"float": "double"} if exchanged else {})
    inputs = {f"u{n}": port for n, port in enumerate(program.inlets.values())}
    outputs = {f"y{n}": port for n, port in enumerate(program.outlets.values())}
    ports = {**inputs, **outputs}
    fields = [f"    {types[port.kind]} {name}[{_size(port)}];" for name, port in ports.items()]
    if exchanged:
        fields.append(f"    double states[{max(1, states)}], slopes[{max(1, states)}];")
    else:
        fields += [f"    {_state_type(value)} {name}[{max(1, value.size)}];" for name, value in program.start.items()]
    variables = [
        f"    {{{C_KINDS[port.kind]}, offsetof(Data, {name}) + {i} * sizeof({types[port.kind]}), "
        f"{_size(port) - i}, {'true' if name in inputs else 'false'}}},"
        for name, port in ports.items()
        for i in range(_size(port))
    ]
    places = {name: f"data->{name}" for name in (*ports, *program.start)}
    if exchanged:
        variables += [
            f"    {{REAL, offsetof(Data, {field}) + {n} * sizeof(double), 1, {settable}}},"
            for field, settable in (("states", "true"), ("slopes", "false"))
            for n in range(states)
        ]
        begins = np.cumsum([0, *(value.size for value in program.start.values())])
        for name, begin in zip(program.start, begins, strict=False):
            places |= {name: f"data->states + {begin}", f"d{name}": f"data->slopes + {begin}"}
        places["time"] = "&data->time"
    given = dict(zip(inputs, program.resting, strict=True)) | program.start
    start = [
        f"    {{ static const {_state_type(value)} start[] = {{{_numbers(value)}}}; "
        f"memcpy({places[name]}, start, sizeof start); }}"
        for name, value in given.items()
        if value.size
    ]
    return {
        "fields": "\n".join(fields),
        "variables": "\n".join([*variables, "    {TIME, 0, 1, false},"]),
        "tick": repr(program.length),
        "most": repr(float(MAX_TICKS)),
        "start": "\n".join(start),
        "arguments": _arguments(program.step, places),
        "shown": "" if exchanged else _arguments(program.outputs, places),
        "real": types["float"],
        "states": str(states),
        "stops": "true" if program.stops else "false",
        "faults": "\n".join(_faults(program)),
    }


def _faults(program: TickProgram | SlopeProgram) -> Iterator[str]:
    """The C that names the first number that is not finite."""
    if isinstance(program, SlopeProgram):
        for n, title in enumerate(program.states):
            yield f"    if (!isfinite(data->slopes[{n}])) return {_text(f'der({title}) is not finite')};"
    else:
        for name, paths in program.owners.items():
            size = program.start[name].size // max(1, len(paths))
            for row, path in enumerate(paths if size else ()):
                loop = f"for (int i = {row * size}; i < {(row + 1) * size}; ++i)"
                yield f"    {loop} if (!isfinite(data->{name}[i])) return {_text(f'{path}: its state is not finite')};"
    for n, (path, port) in enumerate(program.outlets.items()):
        if port.kind == "float" and _size(port):
            test = f"for (int i = 0; i < {_size(port)}; ++i) if (!isfinite(data->y{n}[i]))"
            yield f"    {test} return {_text(f'{path}: is not finite')};"


def _text(text: str) -> str:
    """A literal in C."""
    text = text.replace("%", "%%")  # simulators take it for a format
    return '"' + "".join(chr(b) if chr(b) in PLAIN else f"\\{b:03o}" for b in text.encode()) + '"'


def _arguments(function: Program, places: dict[str, str]) -> str:
    """The arrays of a function in C, each at its place."""
    order = [*function.inputs, *(name for name in function.outputs if name not in function.inputs)]
    return ", ".join(places.get(name, f"data->{name}") for name in order)


def _state_type(value: np.ndarray) -> str:
    return c_type(value.dtype)


def _numbers(value: np.ndarray) -> str:
    return ", ".join(c_literal(number) for number in value.ravel())


def _size(port: Port) -> int:
    return int(np.prod(port.shape))


def _description(
    program: TickProgram | SlopeProgram, name: str, guid: str, version: str, known: Mapping[str, tuple[str, ...]]
) -> bytes:
    """`modelDescription.xml`, in which some ports have `known` names of their numbers."""
    old = version == "2.0"
    key = "guid" if old else "instantiationToken"
    root = ElementTree.Element("fmiModelDescription", fmiVersion=version, modelName=name, generationTool="motorgrad")
    root.set(key, guid)
    exchanged = isinstance(program, SlopeProgram)
    kind = "ModelExchange" if exchanged else "CoSimulation"
    unit = ElementTree.SubElement(root, kind, modelIdentifier=name)
    if old and exchanged:
        root.set("numberOfEventIndicators", "0")
    state = "state" if old else "State"
    steps = () if exchanged else ("canHandleVariableCommunicationStepSize",)
    for able in (f"canGetAndSetFMU{state}", f"canSerializeFMU{state}", *steps):
        unit.set(able, "true")
    if old:
        sources = ElementTree.SubElement(unit, "SourceFiles")
        ElementTree.SubElement(sources, "File", name=f"{name}.c")
    elif not exchanged:
        unit.set("fixedInternalStepSize", repr(program.length))
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(program.length))
    variables = ElementTree.SubElement(root, "ModelVariables")
    structure = ElementTree.SubElement(root, "ModelStructure")
    found: list[tuple[int, int]] = []
    index = reference = 0
    ports = [(n, p, "input", r) for (n, p), r in zip(program.inlets.items(), program.resting, strict=True)]
    ports += [(n, p, "output", None) for n, p in program.outlets.items()]
    for title, port, causality, resting in ports:
        kind = FMI_TYPES[version][("float", "int", "bool").index(port.kind)]
        whole = not old or not port.shape
        for i in range(1 if whole else _size(port)):
            place = "" if whole else f"[{','.join(str(n) for n in np.unravel_index(i, port.shape))}]"
            index += 1
            attributes = {"name": f"{title}{place}", "valueReference": str(reference + i), "causality": causality}
            if title in known:
                attributes["description"] = ", ".join(known[title]) if whole else known[title][i]
            attributes["variability"] = "continuous" if port.kind == "float" else "discrete"
            start = {} if resting is None else {"start": _start(resting if whole else resting.ravel()[i])}
            if old:
                ElementTree.SubElement(ElementTree.SubElement(variables, "ScalarVariable", attributes), kind, start)
            else:
                variable = ElementTree.SubElement(variables, kind, attributes | start)
                for size in port.shape:
                    ElementTree.SubElement(variable, "Dimension", start=str(size))
            if causality == "output":
                found.append((index, reference + i))
        reference += _size(port)
    slopes: list[tuple[int, int]] = []
    if exchanged:
        count = len(program.states)
        starts = [float(x) for value in program.start.values() for x in value.ravel()]
        for n, title in enumerate(program.states):
            about = {"causality": "local", "variability": "continuous", "initial": "exact"}
            _real(variables, old, title, reference + n, about, start=repr(starts[n]))
        for n, title in enumerate(program.states):
            slopes.append((index + count + n + 1, reference + count + n))
            about = {"causality": "local", "variability": "continuous"}
            of = str(index + n + 1 if old else reference + n)
            _real(variables, old, f"der({title})", slopes[-1][1], about, derivative=of)
        reference += 2 * count
    if not old:
        ElementTree.SubElement(
            variables,
            "Float64",
            name="time",
            valueReference=str(reference),
            causality="independent",
            variability="continuous",
        )
    both = [*found, *slopes]
    if old:
        for title, listed in (("Outputs", found), ("Derivatives", slopes), ("InitialUnknowns", both)):
            parent = ElementTree.SubElement(structure, title) if listed else structure
            for place, _ in listed:
                ElementTree.SubElement(parent, "Unknown", index=str(place))
    else:
        for kind, listed in (("Output", found), ("ContinuousStateDerivative", slopes), ("InitialUnknown", both)):
            for _, each in listed:
                ElementTree.SubElement(structure, kind, valueReference=str(each))
    ElementTree.indent(root)
    return ElementTree.tostring(root, "utf-8", xml_declaration=True)


def _real(
    parent: ElementTree.Element, old: bool, name: str, reference: int, about: dict[str, str], **more: str
) -> None:
    """Add a variable that is one real number."""
    attributes = {"name": name, "valueReference": str(reference), **about}
    if old:
        ElementTree.SubElement(ElementTree.SubElement(parent, "ScalarVariable", attributes), "Real", more)
    else:
        ElementTree.SubElement(parent, "Float64", attributes | more)


def _start(value: ArrayLike) -> str:
    array = np.asarray(value)
    words = {True: "true", False: "false"}
    return " ".join(words[bool(x)] if array.dtype == bool else repr(x.item()) for x in array.ravel())


def _build_description(name: str) -> bytes:
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    sources = ElementTree.SubElement(build, "SourceFileSet", language="C99")
    ElementTree.SubElement(sources, "SourceFile", name=f"{name}.c")
    return ElementTree.tostring(root, "utf-8", xml_declaration=True)


def _binary(name: str, version: str) -> str:
    """The place of the compiled code in the unit, for this machine."""
    system = {"linux": "linux", "darwin": "darwin", "win32": "windows"}.get(sys.platform, sys.platform)
    ending = {"linux": ".so", "darwin": ".dylib", "windows": ".dll"}.get(system, ".so")
    machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    old = {"windows": "win64", "darwin": "darwin64"}.get(system, f"{system}64")
    return f"binaries/{old if version == '2.0' else f'{machine}-{system}'}/{name}{ending}"


def _compiled(code: str) -> bytes:
    """The C as a shared library. **Raises** `RuntimeError` without a compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        raise RuntimeError("there is no C compiler (cc): write the sources alone, compiled=False, or install one")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "unit.c"
        library = Path(folder) / "unit.so"
        file.write_text(code)
        done = subprocess.run([compiler, *FLAGS, "-o", library, file, "-lm"], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{compiler} refuses the exported C: {done.stderr.strip()[:500]}")
        return library.read_bytes()


def _zipped(files: dict[str, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, EPOCH), content, zipfile.ZIP_DEFLATED)
    return file.getvalue()
