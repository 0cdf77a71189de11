"""Experiments: every figure and claim of the thesis, and what goes beyond it, by name.

An experiment is a frozen dataclass of its settings with `run`, `figure` and `claims`. `reproduce` runs it or loads what
is stored, draws the figure, judges the claims and leaves a record; `reproduce_all` does so with many, on one machine or
many, and `write_report` puts all records of a folder on one page.
"""

from motorgrad_thesis._claims import (
    Claim,
    Kind,
    Verdict,
    above,
    at_least,
    at_most,
    below,
    count_verdicts,
    in_every,
    more_than_half,
    negative,
    positive,
    within,
)
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment
from motorgrad_thesis._jobs import Reproductions, reproduce_all
from motorgrad_thesis._registry import EXPERIMENTS
from motorgrad_thesis._report import write_report
from motorgrad_thesis._reproduce import Reproduction, reproduce, select_experiments
from motorgrad_thesis._score import Statement, score_rows, score_words, standing, statements

__all__ = [
    "EXPERIMENTS",
    "Claim",
    "Experiment",
    "Kind",
    "Reproduction",
    "Reproductions",
    "Statement",
    "Values",
    "Verdict",
    "Workspace",
    "above",
    "at_least",
    "at_most",
    "below",
    "count_verdicts",
    "experiment",
    "in_every",
    "more_than_half",
    "negative",
    "positive",
    "reproduce",
    "reproduce_all",
    "score_rows",
    "score_words",
    "select_experiments",
    "standing",
    "statements",
    "within",
    "write_report",
]


def listed() -> dict[str, str]:
    """Every experiment by name, with where it is from and its title, for `motorgrad list`."""
    return {name: f"{kind.source}: {kind.title}" for name, kind in EXPERIMENTS.items()}
