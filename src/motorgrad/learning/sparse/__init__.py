"""Thousands of local units with a spatial index: a decision updates only those near the observation."""

from motorgrad.learning.sparse._index import SpatialIndex
from motorgrad.learning.sparse._learner import IndexState, SparseLearner, SparseState

__all__ = ["IndexState", "SparseLearner", "SparseState", "SpatialIndex"]
