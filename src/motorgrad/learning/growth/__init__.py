"""Learners that grow: when a unit is added, where, and how it begins."""

from motorgrad.learning.growth._criteria import Clock, Criterion, Plateau, PlateauState
from motorgrad.learning.growth._growth import Growth, GrowthState
from motorgrad.learning.growth._visited import Visited, VisitedState

__all__ = ["Clock", "Criterion", "Growth", "GrowthState", "Plateau", "PlateauState", "Visited", "VisitedState"]
