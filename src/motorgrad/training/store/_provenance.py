"""What bit-for-bit reproducibility depends on, beside the configuration: versions, compiler flags, processor."""

import datetime
import functools
import importlib.metadata
import os
import platform
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jax

LIBRARIES = "motorgrad jax jaxlib equinox optax mujoco gymnasium cloudpickle numpy scipy numba pyarrow"


def provenance() -> dict[str, Any]:
    """Versions, processor, command and time of this process. Runs are reproducible bit for bit where `versions`,
    `compiler` and `processor` are equal."""
    return {
        "versions": versions(),
        "compiler": {"XLA_FLAGS": os.environ.get("XLA_FLAGS", ""), "computes on": jax.default_backend()},
        "processor": _processor(),
        "system": platform.platform(),
        "cores": os.cpu_count(),
        "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
        "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def provenance_changes(before: dict[str, Any], now: dict[str, Any]) -> Iterator[str]:
    """The differences between two sessions on which bit-for-bit reproducibility depends, in words."""
    were, are = (
        {"processor": each["processor"], **each["versions"], **each.get("compiler", {})} for each in (before, now)
    )
    for name in were.keys() & are.keys():
        if were[name] != are[name]:
            yield f"{name} was {were[name]} and is now {are[name]}"


def versions() -> dict[str, str]:
    """The versions of the libraries on which numbers depend."""
    return {**_installed(), "python": platform.python_version()}


@functools.cache
def _installed() -> dict[str, str]:
    return {name: importlib.metadata.version(name) for name in LIBRARIES.split()}


def release_changes(before: Mapping[str, str], now: Mapping[str, str], names: tuple[str, ...]) -> list[str]:
    """Which of these libraries are of another release, in words; a patch (the third number) is no release."""
    releases = [{name: found.get(name, "").split(".")[:2] for name in names} for found in (before, now)]
    return [
        f"{name} was {before[name]} and is now {now[name]}"
        for name in names
        if name in before and releases[0][name] != releases[1][name]
    ]


def _processor() -> str:
    """The processor's model: `platform.processor()` is empty on many Linux systems."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
