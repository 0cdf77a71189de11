"""Running diagrams: compiled runs, the interpreter, time travel, linearisation, environments."""

# ruff: noqa: F401  (imported to be imported from here; timlab exports the public ones)
from timlab.engine._environment import DiagramEnv, DiagramPolicy
from timlab.engine._fault import RunFault
from timlab.engine._interpreter import Interpreter
from timlab.engine._linear import Linear
from timlab.engine._linearise import linearise, unstable_steps
from timlab.engine._run import MAX_SEEDS, MAX_TICKS, Run
from timlab.engine._state import State
from timlab.engine._timeline import Change, Timeline, replay
