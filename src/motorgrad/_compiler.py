"""How JAX compiles for the processor. Importing this loads nothing: part of it must be said before JAX compiles."""

import functools
import os
from collections.abc import Callable
from typing import Any

THRESHOLD = 4 * 2**20  # bytes: what a core has in its cache
EXTRA = "--xla_backend_extra_options="


def compile_small_loops_whole() -> None:
    """Let XLA compile a loop over little data into one function.

    By default it does so below a kibibyte. Above, every operation of the loop's body is called by itself, some dozens
    in a decision, which takes ten times as long as the decision of one small learner. Where `XLA_FLAGS` has extra
    options already they stay as they are; where JAX has compiled something already, this comes too late.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if EXTRA not in flags:
        ours = f"{EXTRA}xla_cpu_small_while_loop_byte_threshold={THRESHOLD}"
        os.environ["XLA_FLAGS"] = f"{flags} {ours}".strip()


def in_one_piece(function: Callable[..., tuple[Any, Any]]) -> Callable[..., tuple[Any, Any]]:
    """`function(carry, *rest) -> (carry, out)` compiled into one function of the processor, its first argument donated.

    XLA calls the operations of a program one by one, and hands those that could run side by side to other threads,
    which for small ones takes many times as long as to do them. Only a small loop is compiled whole; so it is made one,
    of a single turn. Barriers keep XLA from finding out how many turns there are, and from doing before the loop, piece
    by piece, what does not depend on the carry.
    """
    import jax
    import jax.numpy as jnp

    def loop(carry: Any, *rest: Any) -> tuple[Any, Any]:
        turns = jax.lax.optimization_barrier(jnp.int32(1))
        out = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(function, carry, *rest)[1])

        def turn(state: Any) -> Any:
            turn, carry, _ = state
            return turn + 1, *function(*jax.lax.optimization_barrier((carry, *rest)))

        return jax.lax.while_loop(lambda state: state[0] < turns, turn, (jnp.int32(0), carry, out))[1:]

    return jax.jit(loop, donate_argnums=0, compiler_options=loop_options())


@functools.cache
def loop_options() -> dict[str, Any] | None:
    """Options to compile a loop over decisions with: sums within it are fused with what is around them.

    XLA would hand every sum to a library of its own, which wants seeds to lie first in memory. `None` where this XLA
    has no such library.
    """
    import jax

    options = {"xla_cpu_experimental_ynn_fusion_type": ""}
    try:
        jax.jit(lambda: 0, compiler_options=options)()
    except jax.errors.JaxRuntimeError:
        return None
    return options
