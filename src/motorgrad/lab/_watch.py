"""Looking at outputs that no sink is wired to."""

import dataclasses
from collections.abc import Sequence

from motorgrad._errors import unknown
from motorgrad.lab._flat import Placed, Source
from motorgrad.lab._plan import Plan
from motorgrad.lab.blocks._boundary import Outlet

WATCHED = "/"
"""What the path of a watched output begins with; no block's does."""


def with_watched(plan: Plan, addresses: Sequence[str]) -> Plan:
    """The plan with an outlet at each of these outputs, by their addresses, `"block.port"`.

    **Raises** `ValueError` for one that is not there.
    """
    found = {
        f"{placed.path}.{name}": (Source(i, name), port)
        for i, placed in enumerate(plan.blocks)
        for name, port in placed.block.outputs.items()
    }
    blocks, order = list(plan.blocks), list(plan.order)
    for address in dict.fromkeys(addresses):
        if address not in found:
            raise unknown("output", address, found)
        source, port = found[address]
        order.append(len(blocks))
        outlet = Outlet(port.shape, port.kind)
        blocks.append(Placed(WATCHED + address, WATCHED + address, outlet, {"u": source}, 1))
    return dataclasses.replace(plan, blocks=tuple(blocks), order=tuple(order))


def address_of(placed: Placed, port: str) -> str:
    """Under which address a record has what is at a sink's port."""
    return placed.path.removeprefix(WATCHED) if placed.path.startswith(WATCHED) else f"{placed.path}.{port}"
