"""Experiments: what is learnt, measured and drawn."""

from motorgrad.experiments._motion import motion_of

__all__ = ["motion_of"]
