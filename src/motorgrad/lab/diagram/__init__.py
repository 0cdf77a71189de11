"""Diagrams: blocks with ports, wires between them, and the files they are saved in."""

from motorgrad.lab.diagram._block import (
    BLOCKS,
    Block,
    Host,
    HostBlock,
    HostMoment,
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
    nested,
    parameters_of,
    settings_of,
)
from motorgrad.lab.diagram._diagram import HEAD, LONGEST_NAME, Diagram, End, Inlet, Node, Outlet, numbered_names
from motorgrad.lab.diagram._files import (
    FORMAT,
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
from motorgrad.lab.diagram._flat import DiagramError, Placed, Problem, Source, blocks_of, flatten, shared
from motorgrad.lab.diagram._foreign import Foreign, from_a_file, is_from_a_file
from motorgrad.lab.diagram._gates import Enable, Gate, Trigger
from motorgrad.lab.diagram._moment import Moment, clock, in_precision, rounding
from motorgrad.lab.diagram._picture import outline, to_svg
from motorgrad.lab.diagram._python import to_python
from motorgrad.lab.diagram._record import Record, join, sampled
from motorgrad.lab.diagram._registering import block
from motorgrad.lab.diagram._signals import wired_shapes
from motorgrad.lab.diagram._subsystem import extract, group
from motorgrad.lab.diagram._tags import From, Goto
from motorgrad.lab.diagram._verify import crossings_of, function_problems, kind_of, verify

__all__ = [
    "BLOCKS",
    "FORMAT",
    "HEAD",
    "LONGEST_NAME",
    "SCHEDULE",
    "SUBSYSTEM",
    "Block",
    "Diagram",
    "DiagramError",
    "Enable",
    "End",
    "Foreign",
    "From",
    "Gate",
    "Goto",
    "Host",
    "HostBlock",
    "HostMoment",
    "Inlet",
    "Kind",
    "Moment",
    "Node",
    "Outlet",
    "Parameter",
    "Placed",
    "Port",
    "Ports",
    "Problem",
    "Record",
    "Setting",
    "Signals",
    "Sink",
    "Source",
    "Timing",
    "Trigger",
    "block",
    "blocks_of",
    "checked_shape",
    "clock",
    "crossings_of",
    "dtype_of",
    "dumps",
    "extract",
    "flatten",
    "from_a_file",
    "function_problems",
    "group",
    "in_precision",
    "is_from_a_file",
    "join",
    "kind_of",
    "load",
    "loads",
    "make_block",
    "nested",
    "numbered_names",
    "outline",
    "parameters_of",
    "required_fields",
    "rounding",
    "sampled",
    "save",
    "settings_of",
    "shared",
    "to_python",
    "to_svg",
    "verify",
    "whole_ticks",
    "wired_shapes",
    "with_fields",
]
