"""Ready diagrams."""

from motorgrad.lab.gallery._wiring import learner, record

__all__ = ["learner", "record"]
