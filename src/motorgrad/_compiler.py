"""How JAX compiles for the CPU. Importing this module loads nothing, as one option must be set before JAX starts."""

import functools
import os
from collections import Counter
from collections.abc import Callable
from typing import Any, TypeVar

Carry = TypeVar("Carry")
Out = TypeVar("Out")

THRESHOLD = 4 * 2**20  # bytes, about the cache of a core
EXTRA = "--xla_backend_extra_options="
TRIED = ("0.10.",)  # versions of jaxlib whose XLA knows our option


def compile_small_loops_whole() -> None:
    """Let XLA compile a loop over little data into one function, unless JAX has compiled something.

    By default XLA does so only below 1 KiB. Above, it calls every operation of the loop's body separately, some dozens
    per decision, which for one learner of eight units takes 45 times as long. Extra options already in `XLA_FLAGS` are
    kept.
    """
    from jaxlib.version import __version__  # light, unlike importlib.metadata

    flags = os.environ.get("XLA_FLAGS", "")
    # XLA ends the process for an option that it does not know, so versions that were not tried get none.
    if EXTRA not in flags and __version__.startswith(TRIED):
        ours = f"{EXTRA}xla_cpu_small_while_loop_byte_threshold={THRESHOLD}"
        os.environ["XLA_FLAGS"] = f"{flags} {ours}".strip()


def in_one_piece(function: Callable[..., tuple[Carry, Out]]) -> Callable[..., tuple[Carry, Out]]:
    """Compile `function(carry, *rest) -> (carry, out)` into one CPU function, with `carry` donated.

    XLA calls the operations of a program one by one, and hands independent ones to other threads, which for small ones
    costs many times the work itself. Only small loops are compiled whole, so this wraps the function in a loop of one
    iteration. Barriers hide the iteration count from XLA, and keep operations that do not depend on the carry in the
    loop.
    """
    import jax
    import jax.numpy as jnp

    def loop(carry: Carry, *rest: object) -> tuple[Carry, Out]:
        count = jax.lax.optimization_barrier(jnp.int32(1))
        out = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(function, carry, *rest)[1])

        def iterate(state: tuple[jax.Array, Carry, Out]) -> tuple[jax.Array, Carry, Out]:
            index, carry, _ = state
            return index + 1, *function(*jax.lax.optimization_barrier((carry, *rest)))

        return jax.lax.while_loop(lambda state: state[0] < count, iterate, (jnp.int32(0), carry, out))[1:]

    return jax.jit(loop, donate_argnums=0, compiler_options=loop_options())


@functools.cache
def loop_options() -> dict[str, Any] | None:
    """Compiler options for a loop over decisions: fuse sums with the operations around them, which XLA would otherwise
    hand to a library that requires seeds to be the first axis. `None` if this version of XLA lacks that library."""
    return _if_known({"xla_cpu_experimental_ynn_fusion_type": ""})


@functools.cache
def quick_options(level: int = 1) -> dict[str, Any] | None:
    """Compiler options for a program that is called seldom. It compiles in a third of the time: a program that draws
    random numbers or the weights of networks is thousands of operations, over which LLVM takes seconds.

    At `level` 2 such a program also runs about as fast as by default. At level 0 its results would differ by rounding.
    """
    return _if_known({"xla_backend_optimization_level": level, "xla_cpu_use_fusion_emitters": False})


def _if_known(options: dict[str, Any]) -> dict[str, Any] | None:
    """Compiler options, or `None` if this version of XLA lacks one of them."""
    import jax

    try:
        jax.jit(lambda: 0, compiler_options=options)()
    except jax.errors.JaxRuntimeError:
        return None
    return options


def compilations() -> int:
    """Return the number of programs that JAX has compiled in this process since this was first called."""
    return _compiled()["programs"]


@functools.cache
def _compiled() -> Counter[str]:
    """Let JAX count what it compiles from now on."""
    from jax import monitoring

    counts: Counter[str] = Counter()

    def note(event: str, duration_secs: float, **_: str | int) -> None:
        if event == "/jax/core/compile/backend_compile_duration":
            counts["programs"] += 1

    monitoring.register_event_duration_secs_listener(note)
    return counts
