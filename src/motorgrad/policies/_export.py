"""The functions of a policy that are exported, and the files that hold them."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import jax
import jax.numpy as jnp
from jaxtyping import Array

from motorgrad._errors import check, choice, plain
from motorgrad._files import check_writable, write_atomically
from motorgrad._interface import Interface
from motorgrad.export import NUMPY_LACKS, ONNX_LACKS, Program, Untranslatable, c_source, numpy_file, onnx_model, traced
from motorgrad.policies import abilities
from motorgrad.policies._actor import Decider, decide, known_interface
from motorgrad.policies._parameters import Parametric, parts_of

Example = Array | jax.ShapeDtypeStruct
Function = tuple[Callable[..., dict[str, Array]], Mapping[str, Example]]
Functions = Mapping[str, Function]
"""Functions by name, each with an example of its inputs by name."""
FORMATS = (".c", ".onnx", ".npz")
MAX_COMMENT_NAMES = 200
"""Of the numbers of an observation or an action, in a C file."""


class Exported(Decider, Protocol):
    """What of a `Policy` is exported."""

    @property
    def observation_size(self) -> int: ...
    @property
    def actions(self) -> str | tuple[str, ...]: ...
    def prob(self, observation: Array) -> Array: ...


def export(policy: Exported, path: Path | str, only: Sequence[str] | None = None) -> Path:
    """Write a policy to a file that needs no motorgrad; see `Policy.export`."""
    path = Path(path)
    exported = functions(policy)
    ends = f"a name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}"
    check(path.suffix in FORMATS, "path", str(path), f"{ends}; timlab.write_fmu(policy, path) writes an FMU")
    check_writable("path", path)
    for place, leaf in jax.tree_util.tree_leaves_with_path(policy):
        fine = not jnp.issubdtype(leaf.dtype, jnp.inexact) or bool(jnp.isfinite(leaf).all())
        check(fine, f"policy{jax.tree_util.keystr(place)}", "not all finite", "finite numbers: it has learned nothing")
    for name in exported if only is None else only:
        choice("function", name, exported)
    exported = {name: parts for name, parts in exported.items() if only is None or name in only}
    check(exported, "only", only, "one function at least")
    try:
        content = _content(policy, exported, path)
    except Untranslatable as error:
        fine = [name for name in exported if _fits(policy, {name: exported[name]}, path)]
        remedy = f"; what can be exported: only={tuple(fine)}" if fine else ""
        raise Untranslatable(f"{type(policy).__name__} as {path.suffix}: {error}{remedy}") from None
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, content)
    return path


def _content(policy: Exported, exported: Functions, path: Path) -> bytes:
    meaning = None if policy.interface is None else policy.interface.table()
    if path.suffix == ".onnx":
        return onnx_model(whole(exported), "policy", about(policy), meaning).SerializeToString()
    if path.suffix == ".npz":
        return numpy_file(programs(exported, NUMPY_LACKS), meaning)
    name = re.sub(r"\W|^(?=\d)", "_", path.stem, flags=re.ASCII)
    lines = [] if policy.interface is None else _lines(policy.interface)
    return c_source(programs(exported), name, [about(policy), *HOW, *lines]).encode()


def _lines(interface: Interface) -> list[str]:
    """What the numbers of an exported policy mean, for the comment in its source."""
    seen, code = interface.observations, interface.actions
    found = ["", f"observation: raw, of the shape {seen.shape}, unscaled:"]
    found += [f"  [{place}] {name}" for place, name in enumerate(seen.names[:MAX_COMMENT_NAMES])]
    found += ["  ..."] * (seen.size > MAX_COMMENT_NAMES)
    found.append(f"action: raw, of the shape {code.shape}:")
    names = code.names if code.form in ("same", "clip") and code.kind != "discrete" else ()
    for place in range(min(code.outputs, MAX_COMMENT_NAMES)):
        has_range = code.low is not None and code.high is not None
        limits = f" from {code.low[place]:g} to {code.high[place]:g}" if has_range else ""  # type: ignore[index]
        found.append(f"  [{place}] {names[place] if place < len(names) else ''}{limits}".rstrip())
    found += ["  ..."] * (code.outputs > MAX_COMMENT_NAMES)
    # names come from files of others: none ends the comment, or begins a line of its own
    return [plain(line).replace("*/", "* /").replace("\\", "/").replace("??/", "") for line in found]


def _fits(policy: Exported, exported: Functions, path: Path) -> bool:
    try:
        _content(policy, exported, path)
    except Untranslatable:
        return False
    return True


HOW = (
    "",
    "prob: the firing probability or mean activation of each unit, or the probability of each alternative.",
    "mode: the most probable action. sample: a drawn action, from uniform random numbers in [0, 1).",
    "start: the memory at the start of an episode; mode and sample change it in place.",
)


def about(policy: Exported) -> str:
    """A policy in one line."""
    kind = policy.actions if isinstance(policy.actions, str) else " and ".join(dict.fromkeys(policy.actions))
    return (
        f"A policy of motorgrad: {type(policy).__name__}, {policy.observation_size} observed numbers, {kind} actions."
    )


def functions(policy: Exported) -> Functions:
    """What is exported of a policy."""
    real = jnp.result_type(float)
    interface = policy.interface
    size = policy.observation_size if interface is None else known_interface(policy).observations.size
    given: dict[str, Example] = {"observation": jax.ShapeDtypeStruct((size,), real)}
    start = abilities.initial_memory(policy)
    if start is not None:
        given["memory"] = start

    def prob(observation: Array, memory: Array | None = None) -> dict[str, Array]:
        seen = observation if interface is None else interface.encode(observation)
        return {"prob": policy.prob(abilities.observation_with_memory(policy, memory, seen))}

    def sample(observation: Array, uniforms: Array | None = None, memory: Array | None = None) -> dict[str, Array]:
        action, after = decide(policy, memory, observation, uniforms)
        raw = action if interface is None else interface.decode(action)
        return {"action": raw, **({} if after is None else {"memory": after})}

    def mode(observation: Array, memory: Array | None = None) -> dict[str, Array]:
        return sample(observation, None, memory)

    found: dict[str, Function] = {"prob": (prob, given), "mode": (mode, given)}
    if policy.uniforms:
        found["sample"] = (sample, given | {"uniforms": jax.ShapeDtypeStruct((policy.uniforms,), real)})
    deviation = deviation_of(policy)
    if deviation is not None:
        found["deviation"] = (lambda: {"deviation": deviation}, {})
    if start is not None:
        found["start"] = (lambda: {"memory": start}, {})
    return found


def deviation_of(policy: Any) -> Array | None:
    """The standard deviations of graded units, also behind features and layers; `None` for others."""
    if hasattr(policy, "deviation"):
        return policy.deviation
    parts = parts_of(policy) if isinstance(policy, Parametric) else ()
    return deviation_of(parts[0]) if len(parts) == 1 else None


def programs(exported: Functions, lacks: Collection[str] = ()) -> dict[str, Program]:
    """A program for each function."""
    return {name: traced(function, given, lacks) for name, (function, given) in exported.items()}


def whole(exported: Functions) -> Program:
    """One program of all functions, as an ONNX model has one graph: `prob`, `mode` and `sample` are its outputs, with
    `mode_memory` and `sample_memory` where there is a memory."""
    inputs = {name: example for _, given in exported.values() for name, example in given.items()}

    def joined(**values: Array) -> dict[str, Array]:
        made = {}
        for name, (function, given) in exported.items():
            outputs = function(**{each: values[each] for each in given})
            made |= {name if each in (name, "action") else f"{name}_{each}": value for each, value in outputs.items()}
        return made

    return traced(joined, inputs, ONNX_LACKS)
