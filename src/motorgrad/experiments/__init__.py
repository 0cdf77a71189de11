"""Experiments: every figure and claim of the thesis, and what goes beyond it, by name.

An experiment is a frozen dataclass of its settings with `run`, `figure` and `claims`. `reproduce` runs it or loads what
is stored, draws the figure, judges the claims and leaves a record; `reproduce_all` does so with many, on one machine or
many, and `write_report` puts all records of a folder on one page.
"""

from motorgrad.experiments._claims import (
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
from motorgrad.experiments._experiment import Experiment, Values, Workspace, experiment
from motorgrad.experiments._films import animate, course_of, motion_of
from motorgrad.experiments._jobs import Reproductions, reproduce_all
from motorgrad.experiments._registry import EXPERIMENTS
from motorgrad.experiments._report import write_report
from motorgrad.experiments._reproduce import Reproduction, reproduce, select_experiments
from motorgrad.experiments._score import Statement, score_rows, score_words, standing, statements

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
    "animate",
    "at_least",
    "at_most",
    "below",
    "count_verdicts",
    "course_of",
    "experiment",
    "in_every",
    "more_than_half",
    "motion_of",
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
