"""Where JAX computes: on the processor, unless the user says otherwise. Importing this module loads nothing."""

import functools
import importlib.metadata
import os
import sys
import warnings

ASK = ("JAX_PLATFORMS", "JAX_PLATFORM_NAME")  # variables by which a user says where
PLUGINS = "jax_plugins"  # the entry points of what lets JAX use accelerators

_chosen = False  # by us


def use_the_processor() -> None:
    """Let JAX compute on the processor, unless the user has said where, by a variable or in `jax.config`. A decision of
    a few units is too little work for a GPU, which JAX would otherwise take where it finds one. It must be said before
    JAX computes anything; later, JAX stays where it is."""
    global _chosen
    if any(os.environ.get(name) for name in ASK):
        return
    jax = sys.modules.get("jax")
    if jax is None:
        os.environ["JAX_PLATFORMS"] = "cpu"  # which JAX reads as it is imported
        _chosen = True
    elif not jax.config.jax_platforms and not _started():
        jax.config.update("jax_platforms", "cpu")
        _chosen = True


@functools.cache
def tell_the_platform() -> None:
    """Warn, once, where JAX computes on something else than the processor, or could and does not."""
    import jax

    used = jax.default_backend()
    if used != "cpu":
        better = "for small policies the processor is faster, and is what motorgrad is tested on"
        message = f"JAX computes on {jax.devices()[0]} ({used}): {better}; JAX_PLATFORMS=cpu chooses it"
        warnings.warn(message, stacklevel=3)
    elif _chosen and (found := accelerators()):
        names = ", ".join(found)
        message = f"JAX computes on the processor, though {names} is installed: for small policies it is faster"
        warnings.warn(f"{message}. JAX_PLATFORMS=cuda, set before Python starts, chooses a GPU", stacklevel=3)


def accelerators() -> list[str]:
    """The plugins by which JAX could use an accelerator, by name."""
    return sorted({each.name for each in importlib.metadata.entry_points(group=PLUGINS)})


def _started() -> bool:
    """Whether JAX has begun to compute, after which it cannot be told where."""
    bridge = sys.modules.get("jax._src.xla_bridge")
    return bool(bridge and bridge.backends_are_initialized())
