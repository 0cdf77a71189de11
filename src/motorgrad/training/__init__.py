"""Training: the loop over seeds and decisions, sweeps, run directories, checkpoints and resume."""

from motorgrad._errors import NotTrusted
from motorgrad.training._agents import (
    NamedPolicy,
    agent_for,
    agent_from_table,
    agent_table,
    changed,
    changes_named,
    policy_settings,
)
from motorgrad.training._arguments import check_training
from motorgrad.training._callbacks import EarlyStopping, Report
from motorgrad.training._evaluate import Evaluation, evaluate
from motorgrad.training._load import given_initial, load, saved_config
from motorgrad.training._metrics import final_metrics
from motorgrad.training._policy_score import PolicyScore
from motorgrad.training._run import Run, saved_agent
from motorgrad.training._saving import NotSaved
from motorgrad.training._sweep import setting_text, sweepable
from motorgrad.training._train import resume, train
from motorgrad.training._trust import check_imports
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
from motorgrad.training.plots import Curve, check_tensorboard, folders_of, learning_curves, write_tensorboard
from motorgrad.training.store import (
    RunDirectoryError,
    RunWarning,
    differences,
    fingerprint,
    provenance,
    provenance_changes,
)

__all__ = [
    "BodyStepper",
    "Curve",
    "EarlyStopping",
    "Evaluation",
    "HostStepper",
    "NamedPolicy",
    "NotSaved",
    "NotTrusted",
    "PolicyScore",
    "Report",
    "Run",
    "RunDirectoryError",
    "RunWarning",
    "SideBySide",
    "Stepper",
    "WorldStepper",
    "agent_for",
    "agent_from_table",
    "agent_table",
    "changed",
    "changes_named",
    "check_imports",
    "check_tensorboard",
    "check_training",
    "clear_programs",
    "differences",
    "evaluate",
    "final_metrics",
    "fingerprint",
    "folders_of",
    "given_initial",
    "learning_curves",
    "load",
    "policy_settings",
    "provenance",
    "provenance_changes",
    "resume",
    "saved_agent",
    "saved_config",
    "setting_text",
    "stepper_for",
    "sweepable",
    "train",
    "training_stepper_for",
    "write_tensorboard",
]
