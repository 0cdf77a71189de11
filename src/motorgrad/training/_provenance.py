"""Where a run comes from: what must be the same for its numbers to be the same."""

import datetime
import importlib.metadata
import os
import platform
import sys
from pathlib import Path
from typing import Any

LIBRARIES = ("motorgrad", "jax", "jaxlib", "equinox", "optax", "mujoco", "numpy", "numba", "pyarrow")


def provenance() -> dict[str, Any]:
    """Versions, processor, command and time. Bit-for-bit promises hold where `versions` and `processor` are equal."""
    return {
        "versions": {name: importlib.metadata.version(name) for name in LIBRARIES}
        | {"python": platform.python_version()},
        "processor": _processor(),
        "system": platform.platform(),
        "cores": os.cpu_count(),
        "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
        "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def _processor() -> str:
    """The processor's model: `platform.processor()` is empty on many Linux systems."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
