"""The run directory and its checkpoints."""

from motorgrad.training.store._checkpoint import CorruptCheckpoint, by_name, fill_tree, fingerprint, name_of
from motorgrad.training.store._directory import (
    RunDirectory,
    RunDirectoryError,
    RunWarning,
    provenance,
    provenance_changes,
)

__all__ = [
    "CorruptCheckpoint",
    "RunDirectory",
    "RunDirectoryError",
    "RunWarning",
    "by_name",
    "fill_tree",
    "fingerprint",
    "name_of",
    "provenance",
    "provenance_changes",
]
