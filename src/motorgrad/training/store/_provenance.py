"""Where a run comes from: what must be the same for its numbers to be the same."""

import datetime
import importlib.metadata
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

LIBRARIES = "motorgrad jax jaxlib equinox optax mujoco gymnasium cloudpickle numpy scipy numba pyarrow"


def provenance() -> dict[str, Any]:
    """Versions, processor, command and time. Bit-for-bit promises hold where `versions`, `compiler` and `processor` are
    equal."""
    return {
        "versions": {name: importlib.metadata.version(name) for name in LIBRARIES.split()}
        | {"python": platform.python_version()},
        "compiler": {"XLA_FLAGS": os.environ.get("XLA_FLAGS", "")},
        "processor": _processor(),
        "system": platform.platform(),
        "cores": os.cpu_count(),
        "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
        "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def what_changed(before: dict[str, Any], now: dict[str, Any]) -> Iterator[str]:
    """What differs between two sessions, in words, that bit-for-bit promises depend on."""
    were, are = (
        {"processor": each["processor"], **each["versions"], **each.get("compiler", {})} for each in (before, now)
    )
    for name in were.keys() & are.keys():
        if were[name] != are[name]:
            yield f"{name} was {were[name]} and is now {are[name]}"


def _processor() -> str:
    """The processor's model: `platform.processor()` is empty on many Linux systems."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
