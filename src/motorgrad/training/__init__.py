"""Training: the loop over seeds and decisions, sweeps, run directories, checkpoints and resume."""

from motorgrad._errors import NotTrusted
from motorgrad.learning import PRESETS, Choice, choose
from motorgrad.training._agents import (
    PresetAgent,
    agent_for,
    agent_from_table,
    agent_table,
    bound_to,
    changed,
    changes_named,
    choice_for,
    preset_agent,
    with_changes,
)
from motorgrad.training._arguments import MAX_ENVS, MAX_STEPS, MAX_THREADS, check_training
from motorgrad.training._callbacks import EarlyStopping, Report
from motorgrad.training._episodes import MAX_EPISODES, EpisodeEvaluation
from motorgrad.training._evaluate import STEPS, Evaluation, evaluate
from motorgrad.training._evaluating import EvaluationCallback, KeepBest, evaluating_of
from motorgrad.training._load import given_initial, load, saved_config
from motorgrad.training._metrics import final_metrics
from motorgrad.training._policy_score import PolicyScore
from motorgrad.training._run import Run, saved_agent
from motorgrad.training._saving import NotSaved
from motorgrad.training._sweep import setting_text, sweepable, swept_names
from motorgrad.training._train import resume, train
from motorgrad.training._training import interface_of
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
from motorgrad.training.rollouts import Rollout, check_table, rollout
from motorgrad.training.store import (
    RunDirectoryError,
    RunWarning,
    differences,
    fingerprint,
    provenance,
    provenance_changes,
)

__all__ = [
    "MAX_ENVS",
    "MAX_EPISODES",
    "MAX_STEPS",
    "MAX_THREADS",
    "PRESETS",
    "STEPS",
    "BodyStepper",
    "Choice",
    "Curve",
    "EarlyStopping",
    "EpisodeEvaluation",
    "Evaluation",
    "EvaluationCallback",
    "HostStepper",
    "KeepBest",
    "NotSaved",
    "NotTrusted",
    "PolicyScore",
    "PresetAgent",
    "Report",
    "Rollout",
    "Run",
    "RunDirectoryError",
    "RunWarning",
    "SideBySide",
    "Stepper",
    "WorldStepper",
    "agent_for",
    "agent_from_table",
    "agent_table",
    "bound_to",
    "changed",
    "changes_named",
    "check_imports",
    "check_table",
    "check_tensorboard",
    "check_training",
    "choice_for",
    "choose",
    "clear_programs",
    "differences",
    "evaluate",
    "evaluating_of",
    "final_metrics",
    "fingerprint",
    "folders_of",
    "given_initial",
    "interface_of",
    "learning_curves",
    "load",
    "preset_agent",
    "provenance",
    "provenance_changes",
    "resume",
    "rollout",
    "saved_agent",
    "saved_config",
    "setting_text",
    "stepper_for",
    "sweepable",
    "swept_names",
    "train",
    "training_stepper_for",
    "with_changes",
    "write_tensorboard",
]
