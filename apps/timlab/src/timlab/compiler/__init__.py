"""The compiler: from a diagram to a compiled loop over its ticks."""

# ruff: noqa: F401  (imported to be imported from here; timlab exports the public ones)
from timlab.compiler._adaptive import MAX_CROSSINGS_PER_TICK, MAX_STEPS_PER_TICK, Crossed, advanced, begin
from timlab.compiler._continuous import Continuous
from timlab.compiler._evaluation import Axes, Carry, States, Values
from timlab.compiler._faults import CROSSINGS, LOOP, LOST, NONE, SHORT, SIGNAL, STEPS, owners
from timlab.compiler._host_loop import HostLoop
from timlab.compiler._integrate import integrated, rk4_growth
from timlab.compiler._loops import root
from timlab.compiler._methods import method_named
from timlab.compiler._plan import Plan, address_of, is_mode, plan, problems, with_watched
from timlab.compiler._program import Loop, cached_program
from timlab.compiler._stack import Stacks, stack
from timlab.compiler._step import SPAN, Step, draw_span, draw_start
