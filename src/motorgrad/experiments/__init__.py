"""Experiments: every figure and claim of the thesis, and what goes beyond it, by name.

An experiment is a frozen dataclass of its settings with `run`, `figure` and `claims`. `reproduce` runs it or loads what
is stored, draws the figure, judges the claims and leaves a record; `write_report` puts all records of a folder on one
page.
"""

from motorgrad.experiments._claims import Claim, Measured, exact, mean_of, median_of, share_of
from motorgrad.experiments._experiment import Experiment, Values, Workspace, experiment
from motorgrad.experiments._films import animate, course_of, motion_of, recorded_policies
from motorgrad.experiments._registry import EXPERIMENTS
from motorgrad.experiments._report import write_report
from motorgrad.experiments._reproduce import Reproduction, reproduce, select_experiments

__all__ = [
    "EXPERIMENTS",
    "Claim",
    "Experiment",
    "Measured",
    "Reproduction",
    "Values",
    "Workspace",
    "animate",
    "course_of",
    "exact",
    "experiment",
    "mean_of",
    "median_of",
    "motion_of",
    "recorded_policies",
    "reproduce",
    "select_experiments",
    "share_of",
    "write_report",
]
