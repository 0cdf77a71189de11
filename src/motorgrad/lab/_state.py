"""States of stacks, and the states of the single blocks that they are made of.

Inside the loop rows lead and seeds are last. Outside, states go by the blocks' identities and seeds lead, so that they
outlive an edit of the diagram, and the interpreter takes them too.
"""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._stack import Stacks
from motorgrad.lab._step import Carry

State = dict[str, Any]
"""Of a whole diagram: `tick`; by identity `blocks`, `parameters`, `hosts` and the hosts' `last` outputs."""
BlockState = dict[str, Any]
"""`"state"`, a pytree; `"held"`, the outputs of a block that is not evaluated at every tick."""


def by_block(stacks: Stacks, carry: Carry) -> dict[str, BlockState]:
    """What each block that remembers something remembers, by its identity, as copies in NumPy."""
    found: dict[str, BlockState] = {}
    for k, kind in enumerate(stacks.kinds):
        parts: BlockState = {"state": carry.states.get(k, ()), "held": carry.held.get(k, {})}
        if not jax.tree.leaves(parts):
            continue
        parts = jax.tree.map(lambda x: np.moveaxis(np.asarray(x), -1, 0), parts)
        for row, i in enumerate(kind.members):
            found[stacks.plan.blocks[i].identity] = jax.tree.map(lambda x, row=row: x[:, row].copy(), parts)
    return found


def by_kind(stacks: Stacks, blocks: Mapping[str, BlockState], like: Carry) -> Carry:
    """The inverse of `by_block`, in the types of `like`."""
    states, held = dict(like.states), dict(like.held)
    for k, kind in enumerate(stacks.kinds):
        own: BlockState = {"state": like.states.get(k, ()), "held": like.held.get(k, {})}
        if not jax.tree.leaves(own):
            continue
        rows = [blocks[stacks.plan.blocks[i].identity] for i in kind.members]
        leaves = [jax.tree.leaves(row) for row in rows]
        stacked = [_seeds_last(np.stack(parts, axis=1)) for parts in zip(*leaves, strict=True)]
        whole = jax.tree.unflatten(jax.tree.structure(own), stacked)
        states[k] = whole["state"]
        if k in held:
            held[k] = whole["held"]
    return Carry(states, held)


def misfits(given: Mapping[str, Any], own: Mapping[str, Any]) -> list[str]:
    """The identities whose state is missing in `given`, or of another structure or shape than `own`'s."""

    def shapes(tree: Any) -> Any:
        return jax.tree.structure(tree), [(np.shape(leaf), np.asarray(leaf).dtype) for leaf in jax.tree.leaves(tree)]

    return [name for name, tree in own.items() if name not in given or shapes(given[name]) != shapes(tree)]


def check_state(given: State, own: State) -> None:
    """Refuse a state of another diagram or other seeds than `own`. **Raises** `ValueError` that names the blocks."""
    check(set(own) <= set(given), "state", sorted(given), f"with {', '.join(own)}")
    for part in ("blocks", "parameters", "hosts"):
        wrong = [*misfits(given[part], own[part]), *(given[part].keys() - own[part].keys())]
        check(not wrong, f"state: {part}", wrong, "those of this diagram and these seeds")


def _seeds_last(rows: np.ndarray) -> jax.Array:
    return jnp.asarray(np.moveaxis(rows, 0, -1).copy())
