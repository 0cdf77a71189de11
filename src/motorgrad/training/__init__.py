"""The loop over seeds and decisions, run directories, checkpoints and resume."""

from motorgrad.training._body_stepper import BodyStepper
from motorgrad.training._directory import RunDirectoryError, RunWarning
from motorgrad.training._evaluate import Evaluation, evaluate
from motorgrad.training._plot import learning_curves
from motorgrad.training._provenance import provenance
from motorgrad.training._run import Run, load
from motorgrad.training._settings import ESTIMATORS, AgentSettings, settings_for
from motorgrad.training._stepper import Stepper
from motorgrad.training._train import stepper_of, train
from motorgrad.training._world_stepper import WorldStepper

__all__ = [
    "ESTIMATORS",
    "AgentSettings",
    "BodyStepper",
    "Evaluation",
    "Run",
    "RunDirectoryError",
    "RunWarning",
    "Stepper",
    "WorldStepper",
    "evaluate",
    "learning_curves",
    "load",
    "provenance",
    "settings_for",
    "stepper_of",
    "train",
]
