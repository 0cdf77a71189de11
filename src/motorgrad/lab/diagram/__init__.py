"""Diagrams: blocks with ports, wires between them, and the files they are saved in."""

# ruff: noqa: F401  (imported to be imported from here; motorgrad.lab exports the public ones)
from motorgrad.lab.diagram._block import (
    BLOCKS,
    Block,
    Host,
    HostBlock,
    HostMoment,
    Moment,
    Ports,
    Signals,
    Sink,
    Timing,
    whole_ticks,
)
from motorgrad.lab.diagram._declarations import (
    Kind,
    Parameter,
    Port,
    Setting,
    checked_shape,
    dtype_of,
    parameters_of,
    settings_of,
)
from motorgrad.lab.diagram._diagram import LONGEST_NAME, Diagram, End, Inlet, Node, Outlet, numbered_names
from motorgrad.lab.diagram._files import (
    FORMAT,
    HEAD,
    SCHEDULE,
    SUBSYSTEM,
    dumps,
    load,
    loads,
    make_block,
    required_fields,
    save,
    with_fields,
)
from motorgrad.lab.diagram._flat import DiagramError, Placed, Problem, Source, flatten
from motorgrad.lab.diagram._python import to_python
from motorgrad.lab.diagram._record import Record, join, sampled
from motorgrad.lab.diagram._subsystem import extract, group
from motorgrad.lab.diagram._verify import function_problems, kind_of, verify
