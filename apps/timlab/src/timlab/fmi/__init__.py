"""Functional Mock-up Units: diagrams as units for other simulators."""

from timlab.fmi._step import TickProgram, tick_program
from timlab.fmi._unit import write_fmu

__all__ = ["TickProgram", "tick_program", "write_fmu"]
