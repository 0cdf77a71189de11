"""Compiled loops, kept: a diagram that differs from an earlier one in parameters and names alone is not compiled."""

import threading
from collections import OrderedDict
from typing import Any

import numpy as np

from motorgrad.lab._flat import Placed
from motorgrad.lab._host import HostBlock
from motorgrad.lab._host_loop import HostLoop
from motorgrad.lab._loop import Loop
from motorgrad.lab._stack import Stacks
from motorgrad.lab._step import Step
from motorgrad.lab._verify import kind_of

MOST = 32  # programs kept; the one not used for longest is given up
_kept: "OrderedDict[Any, Loop | HostLoop]" = OrderedDict()
_lock = threading.Lock()


def program(stacks: Stacks, seeds: np.ndarray, axes: dict[int, dict[str, int | None]]) -> Loop | HostLoop:
    """The loop of these stacks for as many seeds, with parameters whose seeds are in these `axes`."""
    plan = stacks.plan
    swept = tuple((k, name) for k, names in axes.items() for name, axis in names.items() if axis is not None)
    blocks = tuple(_structure(placed) for placed in plan.blocks)
    # `moving` is not implied by the blocks' settings and ticks: a source with `period == tick` is held within a tick,
    # one without a period is evaluated again inside an RK4 step
    key = (plan.tick, plan.substeps, blocks, plan.moving, stacks.batches, stacks.rows, swept, len(seeds))
    with _lock:
        if key not in _kept:
            on_host = any(isinstance(kind.block, HostBlock) for kind in stacks.kinds)
            _kept[key] = (HostLoop if on_host else Loop)(Step(stacks), seeds, axes)
        _kept.move_to_end(key)
        while len(_kept) > MOST:
            _kept.popitem(last=False)
        return _kept[key]


def _structure(placed: Placed) -> Any:
    """Of a block, what the compiled loop hangs on: all but its name and its parameters' values."""
    path = placed.path if isinstance(placed.block, HostBlock) else None  # errors of hosts name it
    return kind_of(placed.block), placed.ticks, placed.identity, tuple(placed.sources.items()), path
