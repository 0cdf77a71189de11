"""The functions of a policy that are exported, and the files that hold them."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from motorgrad._errors import check, choice
from motorgrad._files import check_writable, write_atomically
from motorgrad.export import NUMPY_LACKS, ONNX_LACKS, Program, Untranslatable, c_source, numpy_file, onnx_model, traced

if TYPE_CHECKING:
    from motorgrad.policies._policy import Policy

Functions = Mapping[str, tuple[Callable[..., dict[str, Any]], dict[str, Any]]]
"""Functions by name, each with an example of its inputs by name."""
FORMATS = (".c", ".onnx", ".npz")


def export(policy: "Policy", path: Path | str, only: Sequence[str] | None = None) -> Path:
    """Write a policy to a file that needs no motorgrad; see `Policy.export`."""
    path, told = Path(path), functions(policy)
    check(path.suffix in FORMATS, "path", str(path), f"a name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
    check_writable("path", path)
    for place, leaf in jax.tree_util.tree_leaves_with_path(policy):
        fine = not jnp.issubdtype(leaf.dtype, jnp.inexact) or bool(jnp.isfinite(leaf).all())
        check(fine, f"policy{jax.tree_util.keystr(place)}", "not all finite", "finite numbers: it has learned nothing")
    for name in told if only is None else only:
        choice("function", name, told)
    told = {name: parts for name, parts in told.items() if only is None or name in only}
    check(told, "only", only, "one function at least")
    try:
        content = _content(policy, told, path)
    except Untranslatable as error:
        fine = [name for name in told if _fits(policy, {name: told[name]}, path)]
        remedy = f"; what can be exported: only={tuple(fine)}" if fine else ""
        raise Untranslatable(f"{type(policy).__name__} as {path.suffix}: {error}{remedy}") from None
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, content)
    return path


def _content(policy: "Policy", told: Functions, path: Path) -> bytes:
    if path.suffix == ".onnx":
        return onnx_model(whole(told), "policy", about(policy)).SerializeToString()
    if path.suffix == ".npz":
        return numpy_file(programs(told, NUMPY_LACKS))
    name = re.sub(r"\W|^(?=\d)", "_", path.stem, flags=re.ASCII)
    return c_source(programs(told), name, [about(policy), *HOW]).encode()


def _fits(policy: "Policy", told: Functions, path: Path) -> bool:
    try:
        _content(policy, told, path)
    except Untranslatable:
        return False
    return True


HOW = (
    "",
    "prob: the firing probability or mean activation of each unit, or the probability of each alternative.",
    "mode: the most probable action. sample: a drawn action, from uniform random numbers in [0, 1).",
    "start: the memory at the start of an episode; mode and sample change it in place.",
)


def about(policy: "Policy") -> str:
    """A policy in one line."""
    kind = policy.actions if isinstance(policy.actions, str) else " and ".join(dict.fromkeys(policy.actions))
    return (
        f"A policy of motorgrad: {type(policy).__name__}, {policy.observation_size} observed numbers, {kind} actions."
    )


def functions(policy: "Policy") -> Functions:
    """What is exported of a policy."""
    real = jnp.result_type(float)
    given: dict[str, Any] = {"observation": jax.ShapeDtypeStruct((policy.observation_size,), real)}
    start = policy.initial_memory()
    if start is not None:
        given["memory"] = start

    def prob(observation: Any, memory: Any = None) -> dict[str, Any]:
        return {"prob": policy.prob(policy.perceive(memory, observation))}

    def acted(act: Callable[[Any], Any], observation: Any, memory: Any) -> dict[str, Any]:
        seen = policy.perceive(memory, observation)
        action = act(seen)
        after = policy.remember(seen, action)
        return {"action": policy.emit(action), **({} if after is None else {"memory": after})}

    def mode(observation: Any, memory: Any = None) -> dict[str, Any]:
        return acted(policy.mode, observation, memory)

    def sample(observation: Any, uniforms: Any, memory: Any = None) -> dict[str, Any]:
        return acted(lambda seen: policy.sample(seen, uniforms), observation, memory)

    found: dict[str, Any] = {"prob": (prob, given), "mode": (mode, given)}
    if policy.uniforms:
        found["sample"] = (sample, given | {"uniforms": jax.ShapeDtypeStruct((policy.uniforms,), real)})
    deviation = deviation_of(policy)
    if deviation is not None:
        found["deviation"] = (lambda: {"deviation": deviation}, {})
    if start is not None:
        found["start"] = (lambda: {"memory": start}, {})
    return found


def deviation_of(policy: Any) -> Any:
    """The standard deviations of graded units, also behind features and layers; `None` for others."""
    from motorgrad.policies._policy import parts_of

    if hasattr(policy, "deviation"):
        return policy.deviation
    parts = parts_of(policy)
    return deviation_of(parts[0]) if len(parts) == 1 else None


def programs(told: Functions, lacks: Collection[str] = ()) -> dict[str, Program]:
    """A program for each function."""
    return {name: traced(function, given, lacks) for name, (function, given) in told.items()}


def whole(told: Functions) -> Program:
    """One program of all functions, as an ONNX model has one graph: `prob`, `mode` and `sample` are its outputs, with
    `mode_memory` and `sample_memory` where there is a memory."""
    inputs = {name: example for _, given in told.values() for name, example in given.items()}

    def joined(**values: Any) -> dict[str, Any]:
        made = {}
        for name, (function, given) in told.items():
            outputs = function(**{each: values[each] for each in given})
            made |= {name if each in (name, "action") else f"{name}_{each}": value for each, value in outputs.items()}
        return made

    return traced(joined, inputs, ONNX_LACKS)
