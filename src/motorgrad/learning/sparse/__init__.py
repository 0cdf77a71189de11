"""Thousands of local units with a spatial index: a decision updates only those near the observation."""

from motorgrad.learning.sparse._agent import IndexState, SparseAgent
from motorgrad.learning.sparse._index import SpatialIndex

__all__ = ["IndexState", "SparseAgent", "SpatialIndex"]
