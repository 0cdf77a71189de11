"""Experiments: what is learnt, measured and drawn; each figure of the source and each claim, by name.

An experiment is a frozen dataclass of its settings with `run`, `figure` and `claims`; `reproduce` does all three, takes
up what is already there, and leaves a record; `write_report` puts the records of a folder on one page.
"""

from motorgrad.experiments._animate import animate, course_of
from motorgrad.experiments._claim import Claim, Measured, exact, mean_of, median_of, share_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._motion import motion_of
from motorgrad.experiments._recorded import recorded
from motorgrad.experiments._registry import EXPERIMENTS
from motorgrad.experiments._report import write_report
from motorgrad.experiments._reproduce import Reproduction, chosen, reproduce
from motorgrad.experiments._workspace import Workspace

__all__ = [
    "EXPERIMENTS",
    "Claim",
    "Experiment",
    "Measured",
    "Reproduction",
    "Values",
    "Workspace",
    "animate",
    "chosen",
    "course_of",
    "exact",
    "mean_of",
    "median_of",
    "motion_of",
    "recorded",
    "reproduce",
    "share_of",
    "write_report",
]
