"""Running diagrams: compiled runs, the interpreter, time travel, linearisation, environments."""

# ruff: noqa: F401  (imported to be imported from here; motorgrad.lab exports the public ones)
from motorgrad.lab.engine._environment import DiagramEnv, DiagramPolicy
from motorgrad.lab.engine._fault import RunFault
from motorgrad.lab.engine._interpreter import Interpreter
from motorgrad.lab.engine._linearise import Linear, linearise
from motorgrad.lab.engine._run import MOST_SEEDS, MOST_TICKS, Run
from motorgrad.lab.engine._stability import unstable_steps
from motorgrad.lab.engine._state import State
from motorgrad.lab.engine._timeline import Change, Timeline, replay
