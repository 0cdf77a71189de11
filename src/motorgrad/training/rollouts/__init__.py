"""Rollouts: what policies, bodies and worlds do at every moment, as a table."""

from motorgrad.training.rollouts._rollout import rollout
from motorgrad.training.rollouts._saving import FORMATS, check_table
from motorgrad.training.rollouts._table import Rollout

__all__ = ["FORMATS", "Rollout", "check_table", "rollout"]
