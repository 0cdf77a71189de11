"""Functional Mock-up Units: diagrams as units for other simulators."""

from motorgrad.lab.fmi._step import TickProgram, tick_program
from motorgrad.lab.fmi._unit import write_fmu

__all__ = ["TickProgram", "tick_program", "write_fmu"]
