"""The run directory and its checkpoints."""

from motorgrad.training.store._checkpoint import CorruptCheckpoint, fill_tree, fingerprint, part_of
from motorgrad.training.store._directory import RunDirectory, RunDirectoryError, differences
from motorgrad.training.store._provenance import provenance, provenance_changes, release_changes, versions
from motorgrad.training.store._warning import RunWarning, reading_quietly, warn_of_reading

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
    "reading_quietly",
    "release_changes",
    "versions",
    "warn_of_reading",
]
