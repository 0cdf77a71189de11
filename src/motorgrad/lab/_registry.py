"""The types of blocks by name. A new block is one new file and one line here."""

from motorgrad.lab._block import Block
from motorgrad.lab.blocks._boundary import Inlet, Outlet
from motorgrad.lab.blocks._constant import Constant
from motorgrad.lab.blocks._gain import Gain
from motorgrad.lab.blocks._integrator import Integrator
from motorgrad.lab.blocks._sum import Sum
from motorgrad.lab.blocks._unit_delay import UnitDelay

BLOCKS: dict[str, type[Block]] = {
    kind.name: kind
    for kind in (
        Constant,
        Gain,
        Inlet,
        Integrator,
        Outlet,
        Sum,
        UnitDelay,
    )
}
"""The class of every type of block, by name; a block of your own may be added."""
