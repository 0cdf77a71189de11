"""Rollouts: what policies, bodies and worlds do at every moment, as a table."""

from motorgrad.training.rollout._rollout import rollout
from motorgrad.training.rollout._saving import FORMATS, check_table
from motorgrad.training.rollout._table import Rollout

__all__ = ["FORMATS", "Rollout", "check_table", "rollout"]
