"""States of runs: split by block outside of compiled code, stacked by kind inside.

Inside the loop, rows lead and seeds come last. Outside, states go by the blocks' identities and seeds lead, so that
they survive an edit of the diagram and fit the interpreter too.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from motorgrad._errors import check
from timlab.compiler import Carry, Stacks
from timlab.diagram import in_precision

State = dict[str, Any]
"""The state of a diagram: `tick`; by identity `blocks`, `parameters`, `hosts` and the hosts' `last` outputs; with a
solver that adapts its steps, the length of the next one as `pace`."""
BlockState = dict[str, Any]
"""`"state"`, a pytree; `"held"`, the outputs of a block that is not evaluated at every tick; and where the block has
any, `"above"`, which of its zero crossings count as not negative, and `"shares"`, see `Moment.shares`."""


def _parts(carry: Carry, k: int) -> BlockState:
    """The state of a kind."""
    parts: BlockState = {"state": carry.states.get(k, ()), "held": carry.held.get(k, {})}
    parts |= {"above": carry.above[k]} if k in carry.above else {}
    return parts | ({"shares": carry.shares[k]} if k in carry.shares else {})


def precisely(method: Callable[..., Any]) -> Any:
    """A method of a run that computes in the precision of its plan."""

    @functools.wraps(method)
    def wrapped(self: Any, *arguments: Any, **named: Any) -> Any:
        with in_precision(self.plan.solver.precision):
            return method(self, *arguments, **named)

    return wrapped


def split_by_block(stacks: Stacks, carry: Carry) -> dict[str, BlockState]:
    """The state of each block that has one, by its identity, as NumPy copies."""
    found: dict[str, BlockState] = {}
    for k, kind in enumerate(stacks.kinds):
        parts = _parts(carry, k)
        if not jax.tree.leaves(parts):
            continue
        parts = jax.tree.map(lambda x: np.moveaxis(np.asarray(x), -1, 0), parts)
        for row, i in enumerate(kind.members):
            found[stacks.plan.blocks[i].identity] = jax.tree.map(lambda x, row=row: x[:, row].copy(), parts)
    return found


def states_of(stacks: Stacks, carry: Carry, seed: int) -> dict[int, Any]:
    """The state of each block that has one, of the seed in one row."""
    return {
        i: jax.tree.map(lambda x, row=row: np.asarray(x[row, ..., seed]), carry.states[k])
        for k, kind in enumerate(stacks.kinds)
        if jax.tree.leaves(carry.states.get(k, ()))
        for row, i in enumerate(kind.members)
    }


def finite_leaves(carry: Carry) -> np.ndarray:
    """As `Step.finite` of the states and of what is held, on the host."""
    leaves = map(np.asarray, jax.tree.leaves((carry.states, carry.held)))
    return np.array([True, *(bool(np.isfinite(leaf).all()) for leaf in leaves if leaf.dtype.kind == "f")])


def not_finite(stacks: Stacks, carry: Carry) -> list[int]:
    """The blocks in whose state a number is NaN or infinite."""
    found: set[int] = set()
    for k, kind in enumerate(stacks.kinds):
        for leaf in map(np.asarray, jax.tree.leaves((carry.states.get(k, ()), carry.held.get(k, {})))):
            if leaf.dtype.kind == "f":
                wrong = ~np.isfinite(leaf).reshape(len(kind.members), -1).all(axis=1)
                found |= {kind.members[row] for row in np.flatnonzero(wrong)}
    return sorted(found)


def stack_by_kind(stacks: Stacks, blocks: Mapping[str, BlockState], like: Carry) -> Carry:
    """The inverse of `split_by_block`, in the dtypes of `like`."""
    states = dict(like.states)
    held = dict(like.held)
    above = dict(like.above)
    shares = dict(like.shares)
    for k, kind in enumerate(stacks.kinds):
        own = _parts(like, k)
        if not jax.tree.leaves(own):
            continue
        rows = [blocks[stacks.plan.blocks[i].identity] for i in kind.members]
        leaves = [jax.tree.leaves(row) for row in rows]
        stacked = [
            jnp.asarray(np.moveaxis(np.stack(parts, axis=1), 0, -1).copy()) for parts in zip(*leaves, strict=True)
        ]
        whole = jax.tree.unflatten(jax.tree.structure(own), stacked)
        states[k] = whole["state"]
        if k in held:
            held[k] = whole["held"]
        if k in above:
            above[k] = whole["above"]
        if k in shares:
            shares[k] = whole["shares"]
    return Carry(states, held, above, like.pace, shares, like.fault)


def mismatches(given: Mapping[str, Any], own: Mapping[str, Any]) -> list[str]:
    """The identities whose state in `given` is missing, or differs in structure or shape from `own`."""

    def shapes(tree: PyTree[np.ndarray]) -> tuple[object, list[tuple[object, ...]]]:
        return jax.tree.structure(tree), [(np.shape(leaf), np.asarray(leaf).dtype) for leaf in jax.tree.leaves(tree)]

    return [name for name, tree in own.items() if name not in given or shapes(given[name]) != shapes(tree)]


def check_state(given: State, own: State) -> None:
    """Refuse the state of another diagram or of other seeds than `own`. **Raises** `ValueError` that names the
    blocks.
    """
    check(set(own) <= set(given), "state", sorted(given), f"with {', '.join(own)}")
    for part in ("blocks", "parameters", "hosts"):
        wrong = [*mismatches(given[part], own[part]), *(given[part].keys() - own[part].keys())]
        check(not wrong, f"state: {part}", wrong, "those of this diagram and these seeds")
