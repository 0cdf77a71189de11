r"""TimLab: dynamical systems, controllers and learners built of blocks.

    import motorgrad as mg

    diagram = mg.lab.Diagram(tick=0.01)
    diagram.add("input", mg.lab.Constant(1.0))
    diagram.add("error", mg.lab.Sum("+-"))
    diagram.add("speed", mg.lab.Gain(2.0))
    diagram.add("level", mg.lab.Integrator())
    diagram.connect("input", "error.u1")
    diagram.connect("level", "error.u2")
    diagram.connect("error", "speed")
    diagram.connect("speed", "level")

**What happens in a tick.** All outputs are computed in an order in which every block comes after those that it reads
from; then all states move, each by the inputs of this tick. Whatever an output does *not* depend on at once (an input
declared with `feedthrough=False`) may come later in that order, so such a block cuts a loop. Between ticks the
continuous blocks are integrated by RK4: they, and what they reach without delay through blocks that have neither state
nor chance, are evaluated again inside the step; everything else is evaluated once, and held.

**How to write a block.** One small file in `lab/blocks/` with one frozen dataclass, and one line in
`lab/_registry.py`. See `lab/blocks/_gain.py` (pure), `_unit_delay.py` (state), `_integrator.py` (continuous).

    @dataclasses.dataclass(frozen=True)
    class Leak(Block):
        "Forgets: $x \leftarrow \beta x + u$."

        name: ClassVar[str] = "leak"                     # in files and in the registry
        category: ClassVar[str] = "dynamics"             # in the palette
        # a parameter may change while it runs, a setting may not
        decay: Annotated[Any, Parameter("what is kept", low=0.0, high=1.0)] = 0.9
        shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

        def validate(self): ...                          # what must fit together; parameters are plain numbers here
        @property
        def inputs(self): return {"u": Port(self.shape, feedthrough=False)}
        @property
        def outputs(self): return {"y": Port(self.shape)}

        def init(self, uniforms): return jnp.zeros(self.shape)
        def output(self, state, inputs, now): return {"y": state}
        def update(self, state, inputs, now): return self.decay * state + inputs["u"]

- The functions are pure, of one seed, in `jax.numpy`. They see arrays in place of parameters (`self.decay`), and may
  not branch on them in Python; settings are plain. Blocks of one type and the same settings are evaluated as one, by
  `jax.vmap`.
- The state is any pytree of arrays with fixed shapes and types: a number, a dictionary, a named tuple, a policy.
- `output` is handed only inputs with feedthrough. `update` and `derivative` are handed all.
- Whether outputs depend on an input at once may hang on a setting, not on a parameter.
- Chance: say how many numbers from U[0, 1) a tick consumes by a property `uniforms` (and `init_uniforms`), and take
  them from `now.uniforms`: they are the same in `output` and `update`. They go by the seed, the block's id and the
  tick. A block with the id `"policy"` has the numbers that a policy has in training, `"world"` those of a world.
- Time: `now.time` in seconds, `now.tick`, and `now.step`, the block's own sample period. A stateless source that
  depends on time says `timed: ClassVar[bool] = True`, so that it is evaluated inside RK4 steps too.
- Wires carry arrays of fixed shape, not trees. A learning block gives its score as one flat vector in the order of
  `jax.flatten_util.ravel_pytree(trainable(policy))`, and takes its step in the same order. Learnt parameters are state,
  and a step taken in by a port with feedthrough acts at the same tick.
- A sink is a `Sink` with inputs and settings; its inputs are recorded, and nothing of it runs.
- A simulator or environment is a `HostBlock`, whose `start` gives a `Host` for all seeds at once. Where no output
  depends on an input at once, declare so: then a tick is one compiled call.
"""

from typing import Any

from motorgrad.lab._block import Block, Moment, Ports, Signals, whole_ticks
from motorgrad.lab._diagram import Diagram, Node
from motorgrad.lab._edit import edit
from motorgrad.lab._environment import DiagramEnv, DiagramPolicy
from motorgrad.lab._files import dumps, load, loads, save
from motorgrad.lab._host import Host, HostBlock, HostMoment
from motorgrad.lab._interpreter import Interpreter
from motorgrad.lab._linearise import Linear, linearise
from motorgrad.lab._parameter import Parameter, Setting, parameters_of, settings_of
from motorgrad.lab._plan import problems
from motorgrad.lab._port import Port
from motorgrad.lab._problems import DiagramError, Problem
from motorgrad.lab._python import to_python
from motorgrad.lab._record import Record, join
from motorgrad.lab._registry import BLOCKS
from motorgrad.lab._run import Run
from motorgrad.lab._sink import Sink
from motorgrad.lab._subsystem import cut, group
from motorgrad.lab._timeline import Change, Timeline, replay
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
from motorgrad.lab.blocks._viewer import Viewer
from motorgrad.lab.blocks._waves import Chirp, Pulse, Sine
from motorgrad.lab.blocks.learning import (
    Gaussians,
    GradientMean,
    GradientSample,
    GrowingGaussians,
    Hyperplanes,
    Learner,
    Motoneurons,
    NamedPolicy,
    Softmax,
    WeightDecay,
)
from motorgrad.lab.blocks.worlds import Body, Environment, MujocoModel, MuscleLaw, World
from motorgrad.lab.gallery import GALLERY, example


def __getattr__(title: str) -> Any:
    """The block of a registered part of a learner by the name of its class, such as `EligibilityTrace`."""
    from motorgrad.lab.blocks.learning import PART_BLOCKS

    return PART_BLOCKS.by_title(title)


__all__ = [
    "BLOCKS",
    "GALLERY",
    "PID",
    "Backlash",
    "Block",
    "Body",
    "Change",
    "Chirp",
    "Compare",
    "Constant",
    "Counter",
    "DataFile",
    "DeadZone",
    "Delay",
    "Diagram",
    "DiagramEnv",
    "DiagramError",
    "DiagramPolicy",
    "DiscreteIntegrator",
    "DiscreteLag",
    "DiscretePID",
    "DiscreteStateSpace",
    "DiscreteTransferFunction",
    "Environment",
    "Expression",
    "Function",
    "Gain",
    "Gaussians",
    "GradientMean",
    "GradientSample",
    "GrowingGaussians",
    "Histogram",
    "Host",
    "HostBlock",
    "HostMoment",
    "Hyperplanes",
    "Inlet",
    "Integrator",
    "Interpreter",
    "Join",
    "Lag",
    "Learner",
    "Linear",
    "Logic",
    "LookUp",
    "LookUp2D",
    "MatrixGain",
    "Moment",
    "Motoneurons",
    "MujocoModel",
    "MultiSwitch",
    "MuscleLaw",
    "NamedPolicy",
    "Node",
    "NormalNoise",
    "Not",
    "Outlet",
    "Parameter",
    "PolicyMap",
    "Port",
    "Portrait",
    "Ports",
    "Problem",
    "Product",
    "Pulse",
    "Quantiser",
    "Ramp",
    "Raster",
    "RateLimit",
    "Record",
    "Recorder",
    "Reduce",
    "Relay",
    "Run",
    "SampleAndHold",
    "Saturation",
    "Scope",
    "Select",
    "Setting",
    "Signals",
    "Sine",
    "Sink",
    "Softmax",
    "StateMachine",
    "StateSpace",
    "Step",
    "Sum",
    "Switch",
    "Timeline",
    "TransferFunction",
    "UniformNoise",
    "UnitDelay",
    "Viewer",
    "WeightDecay",
    "World",
    "cut",
    "dumps",
    "edit",
    "example",
    "group",
    "join",
    "linearise",
    "load",
    "loads",
    "parameters_of",
    "problems",
    "replay",
    "save",
    "settings_of",
    "to_python",
    "whole_ticks",
]
