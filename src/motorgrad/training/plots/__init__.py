"""Learning curves as figures, and as TensorBoard event files. Drawing loads matplotlib when it is first used."""

from motorgrad.training.plots._plot import Format, figure_file, learning_curves
from motorgrad.training.plots._plot_curves import Axis, Curve, axis_for, curve_of, mean_of_last
from motorgrad.training.plots._plot_labels import folders_of
from motorgrad.training.plots._tensorboard import EventFiles, check_tensorboard, start_time, write_tensorboard

__all__ = [
    "Axis",
    "Curve",
    "EventFiles",
    "Format",
    "axis_for",
    "check_tensorboard",
    "curve_of",
    "figure_file",
    "folders_of",
    "learning_curves",
    "mean_of_last",
    "start_time",
    "write_tensorboard",
]
