"""The compiler: from a diagram to a compiled loop over its ticks."""

# ruff: noqa: F401  (imported to be imported from here; motorgrad.lab exports the public ones)
from motorgrad.lab.compiler._adaptive import MOST_EVENTS, MOST_STEPS, advanced, begin
from motorgrad.lab.compiler._continuous import Continuous
from motorgrad.lab.compiler._faults import CROSSINGS, LOOP, LOST, NONE, SHORT, SIGNAL, STEPS, owners
from motorgrad.lab.compiler._host_loop import HostLoop
from motorgrad.lab.compiler._integrate import integrated, rk4_growth
from motorgrad.lab.compiler._loops import root
from motorgrad.lab.compiler._methods import METHODS
from motorgrad.lab.compiler._plan import Plan, address_of, is_mode, plan, problems, with_watched
from motorgrad.lab.compiler._program import Loop, cached_program
from motorgrad.lab.compiler._stack import Stacks, stack
from motorgrad.lab.compiler._step import SPAN, Carry, Step, Values, draw_span, draw_start
