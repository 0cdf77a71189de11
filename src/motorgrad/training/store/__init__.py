"""The run directory and its checkpoints."""

from motorgrad.training.store._checkpoint import CorruptCheckpoint, by_name, fill_tree, fingerprint, name_of
from motorgrad.training.store._directory import RunDirectory, RunDirectoryError, RunWarning, differences
from motorgrad.training.store._provenance import provenance, provenance_changes, release_changes, versions

__all__ = [
    "CorruptCheckpoint",
    "RunDirectory",
    "RunDirectoryError",
    "RunWarning",
    "by_name",
    "differences",
    "fill_tree",
    "fingerprint",
    "name_of",
    "provenance",
    "provenance_changes",
    "release_changes",
    "versions",
]
