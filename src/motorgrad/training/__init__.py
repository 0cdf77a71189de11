"""The loop over seeds and decisions, run directories, checkpoints and resume."""

from motorgrad.training._arguments import check_training
from motorgrad.training._body_stepper import BodyStepper
from motorgrad.training._checkpoint import fingerprint
from motorgrad.training._directory import RunDirectoryError, RunWarning
from motorgrad.training._evaluate import Evaluation, evaluate
from motorgrad.training._host_stepper import HostStepper
from motorgrad.training._plot import learning_curves
from motorgrad.training._plot_curves import Curve
from motorgrad.training._plot_labels import folders_of
from motorgrad.training._provenance import provenance, what_changed
from motorgrad.training._resume import resume, settings_in
from motorgrad.training._run import Run, given_initial, load
from motorgrad.training._settings import AgentSettings, settings_for, settled
from motorgrad.training._settings_parts import ESTIMATORS
from motorgrad.training._side_by_side import SideBySide
from motorgrad.training._stepper import Stepper
from motorgrad.training._tensorboard import check_tensorboard, write_tensorboard
from motorgrad.training._train import learner_of, stepper_of, train
from motorgrad.training._world_stepper import WorldStepper

__all__ = [
    "ESTIMATORS",
    "AgentSettings",
    "BodyStepper",
    "Curve",
    "Evaluation",
    "HostStepper",
    "Run",
    "RunDirectoryError",
    "RunWarning",
    "SideBySide",
    "Stepper",
    "WorldStepper",
    "check_tensorboard",
    "check_training",
    "evaluate",
    "fingerprint",
    "folders_of",
    "given_initial",
    "learner_of",
    "learning_curves",
    "load",
    "provenance",
    "resume",
    "settings_for",
    "settings_in",
    "settled",
    "stepper_of",
    "train",
    "what_changed",
    "write_tensorboard",
]
