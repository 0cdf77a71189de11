"""The types of blocks by name. A new block is one new file and one line here. Blocks of registered parts of learners
need no line."""

from collections import ChainMap
from collections.abc import MutableMapping

from motorgrad.lab._block import Block
from motorgrad.lab.blocks import learning, worlds
from motorgrad.lab.blocks._boundary import Inlet, Outlet
from motorgrad.lab.blocks._compare import Compare, Logic, Not
from motorgrad.lab.blocks._constant import Constant
from motorgrad.lab.blocks._data_file import DataFile
from motorgrad.lab.blocks._delay import Delay
from motorgrad.lab.blocks._discrete_integrator import DiscreteIntegrator
from motorgrad.lab.blocks._events import Counter, SampleAndHold
from motorgrad.lab.blocks._formula import Expression, Function
from motorgrad.lab.blocks._gain import Gain
from motorgrad.lab.blocks._hysteresis import Backlash, RateLimit, Relay
from motorgrad.lab.blocks._integrator import Integrator
from motorgrad.lab.blocks._lag import DiscreteLag, Lag
from motorgrad.lab.blocks._limits import DeadZone, Quantiser, Saturation
from motorgrad.lab.blocks._linear import DiscreteStateSpace, DiscreteTransferFunction, StateSpace, TransferFunction
from motorgrad.lab.blocks._lookup import LookUp, LookUp2D
from motorgrad.lab.blocks._noise import NormalNoise, UniformNoise
from motorgrad.lab.blocks._pid import PID, DiscretePID
from motorgrad.lab.blocks._policy_map import PolicyMap
from motorgrad.lab.blocks._product import MatrixGain, Product
from motorgrad.lab.blocks._raster import Histogram, Raster
from motorgrad.lab.blocks._recorder import Recorder
from motorgrad.lab.blocks._scope import Portrait, Scope
from motorgrad.lab.blocks._state_machine import StateMachine
from motorgrad.lab.blocks._step import Ramp, Step
from motorgrad.lab.blocks._sum import Sum
from motorgrad.lab.blocks._switch import MultiSwitch, Switch
from motorgrad.lab.blocks._unit_delay import UnitDelay
from motorgrad.lab.blocks._vectors import Join, Reduce, Select
from motorgrad.lab.blocks._waves import Chirp, Pulse, Sine

_OWN: dict[str, type[Block]] = {
    kind.name: kind
    for kind in (
        Backlash,
        Chirp,
        Compare,
        Constant,
        Counter,
        DataFile,
        DeadZone,
        Delay,
        DiscreteIntegrator,
        DiscreteLag,
        DiscretePID,
        DiscreteStateSpace,
        DiscreteTransferFunction,
        Expression,
        Function,
        Gain,
        Histogram,
        Inlet,
        Integrator,
        Join,
        Lag,
        Logic,
        LookUp,
        LookUp2D,
        MatrixGain,
        MultiSwitch,
        NormalNoise,
        Not,
        Outlet,
        PID,
        PolicyMap,
        Portrait,
        Product,
        Pulse,
        Quantiser,
        Ramp,
        Raster,
        RateLimit,
        Recorder,
        Reduce,
        Relay,
        SampleAndHold,
        Saturation,
        Scope,
        Select,
        Sine,
        StateMachine,
        StateSpace,
        Step,
        Sum,
        Switch,
        TransferFunction,
        UniformNoise,
        UnitDelay,
        *learning.BLOCKS,
        *worlds.BLOCKS,
    )
}
BLOCKS: MutableMapping[str, type[Block]] = ChainMap(_OWN, learning.PART_BLOCKS)  # type: ignore[arg-type]
"""The class of every type of block, by name; a block of your own may be added."""
