"""How JAX compiles for the processor. This has to be said before it compiles anything, and loads nothing."""

import os

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
