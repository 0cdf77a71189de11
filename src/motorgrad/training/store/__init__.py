"""The run directory and its checkpoints."""

from motorgrad.training.store._checkpoint import CorruptCheckpoint, fill_tree, fingerprint, part_of
from motorgrad.training.store._directory import RunDirectory, RunDirectoryError, RunWarning, differences
from motorgrad.training.store._provenance import provenance, provenance_changes, release_changes, versions

__all__ = [
    "CorruptCheckpoint",
    "RunDirectory",
    "RunDirectoryError",
    "RunWarning",
    "differences",
    "fill_tree",
    "fingerprint",
    "part_of",
    "provenance",
    "provenance_changes",
    "release_changes",
    "versions",
]
