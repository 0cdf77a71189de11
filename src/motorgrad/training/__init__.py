"""Training: the loop over seeds and decisions, sweeps, run directories, checkpoints and resume."""

from motorgrad.training._agents import NamedPolicy, agent_for, agent_from_table, agent_table, policy_settings
from motorgrad.training._arguments import check_training
from motorgrad.training._evaluate import Evaluation, evaluate
from motorgrad.training._resume import agent_in, resume
from motorgrad.training._run import Run, given_initial, load
from motorgrad.training._train import train
from motorgrad.training.engines import (
    BodyStepper,
    HostStepper,
    SideBySide,
    Stepper,
    WorldStepper,
    clear_programs,
    stepper_for,
    training_stepper_for,
)
from motorgrad.training.plots._plot import learning_curves
from motorgrad.training.plots._plot_curves import Curve
from motorgrad.training.plots._plot_labels import folders_of
from motorgrad.training.plots._tensorboard import check_tensorboard, write_tensorboard
from motorgrad.training.store._checkpoint import fingerprint
from motorgrad.training.store._directory import RunDirectoryError, RunWarning
from motorgrad.training.store._provenance import provenance, what_changed

__all__ = [
    "BodyStepper",
    "Curve",
    "Evaluation",
    "HostStepper",
    "NamedPolicy",
    "Run",
    "RunDirectoryError",
    "RunWarning",
    "SideBySide",
    "Stepper",
    "WorldStepper",
    "agent_for",
    "agent_from_table",
    "agent_in",
    "agent_table",
    "check_tensorboard",
    "check_training",
    "clear_programs",
    "evaluate",
    "fingerprint",
    "folders_of",
    "given_initial",
    "learning_curves",
    "load",
    "policy_settings",
    "provenance",
    "resume",
    "stepper_for",
    "train",
    "training_stepper_for",
    "what_changed",
    "write_tensorboard",
]
