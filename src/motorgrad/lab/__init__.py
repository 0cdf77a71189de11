r"""TimLab: dynamical systems, controllers and learners built from blocks.

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

**One tick.** First, all outputs are computed, each block after the blocks it reads from. Then all states advance,
using the inputs of this tick. An input declared with `feedthrough=False` does not affect the outputs of the same tick,
so a block with such an input breaks a loop. Between ticks, continuous blocks are integrated by RK4: they, and every
stateless and deterministic block that they reach without delay, are evaluated again inside the step. Everything else is
evaluated once per tick and held.

**Writing a block.** A block is one frozen dataclass in a file of `lab/blocks/`, plus one line in
`lab/blocks/__init__.py`. For examples, see `Gain` (stateless) in `lab/blocks/_maths.py`, `UnitDelay` (discrete state)
and `Integrator` (continuous state) in `lab/blocks/_linear.py`.

    @dataclasses.dataclass(frozen=True)
    class Leak(Block):
        "Leaky accumulator: $x \leftarrow \beta x + u$."

        name: ClassVar[str] = "leak"                     # in files and in the registry
        category: ClassVar[str] = "dynamics"             # in the palette
        # a parameter can change during a run, a setting cannot
        decay: Annotated[Any, Parameter("the fraction kept per tick", low=0.0, high=1.0)] = 0.9
        shape: Annotated[tuple[int, ...], Setting("shape of the signals")] = ()

        def validate(self): ...                          # check combinations; parameters are plain numbers here
        @property
        def inputs(self): return {"u": Port(self.shape, feedthrough=False)}
        @property
        def outputs(self): return {"y": Port(self.shape)}

        def init(self, uniforms): return jnp.zeros(self.shape)
        def output(self, state, inputs, now): return {"y": state}
        def update(self, state, inputs, now): return self.decay * state + inputs["u"]

- The functions are pure, handle one seed, and use `jax.numpy`. Parameters (`self.decay`) are traced arrays in them, so
  Python may not branch on their values; settings are plain values. Blocks of one type with equal settings are evaluated
  together by `jax.vmap`.
- The state is any pytree of arrays with fixed shapes and dtypes: a number, a dictionary, a named tuple, a policy.
- `output` receives only the inputs with feedthrough. `update` and `derivative` receive all inputs.
- Feedthrough may depend on a setting, not on a parameter.
- Random numbers: the properties `uniforms` and `init_uniforms` declare how many numbers from U[0, 1) a tick and `init`
  consume; `now.uniforms` has them, the same in `output` and `update`. They are determined by the seed, the block's id
  and the tick. A block with the id `"policy"` gets the numbers that a policy gets in training, one with the id
  `"world"` those of a world.
- Time: `now.time` in seconds, `now.tick`, and `now.step`, the block's sample period. A stateless source that depends on
  time sets `timed: ClassVar[bool] = True`, so that it is evaluated inside RK4 steps too.
- Wires carry arrays of fixed shape, not pytrees. A learning block outputs its score as one flat vector in the order of
  `jax.flatten_util.ravel_pytree(trainable(policy))`, and receives its step in the same order. Learned parameters are
  state; a step that arrives at a port with feedthrough takes effect at the same tick.
- A `Sink` has inputs and settings only. Its inputs are recorded; none of its code runs in a tick.
- A simulator or environment is a `HostBlock`, whose `start` returns one `Host` for all seeds. Declare its inputs
  without feedthrough where possible: a tick is then a single compiled call.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import motorgrad.lab.blocks as _blocks
from motorgrad.lab.blocks import *  # noqa: F403  (every registered block is exported)
from motorgrad.lab.compiler import problems
from motorgrad.lab.diagram import (
    BLOCKS,
    Block,
    Diagram,
    DiagramError,
    Host,
    HostBlock,
    HostMoment,
    Moment,
    Node,
    Parameter,
    Port,
    Ports,
    Problem,
    Record,
    Setting,
    Signals,
    Sink,
    dumps,
    extract,
    group,
    join,
    load,
    loads,
    parameters_of,
    save,
    settings_of,
    to_python,
    whole_ticks,
)
from motorgrad.lab.engine import (
    Change,
    DiagramEnv,
    DiagramPolicy,
    Interpreter,
    Linear,
    Run,
    Timeline,
    linearise,
    replay,
)
from motorgrad.lab.gallery import GALLERY, example

if TYPE_CHECKING:
    from motorgrad.lab.editor._widget import Editor

__all__ = [
    "BLOCKS",
    "GALLERY",
    "Block",
    "Change",
    "Diagram",
    "DiagramEnv",
    "DiagramError",
    "DiagramPolicy",
    "Host",
    "HostBlock",
    "HostMoment",
    "Interpreter",
    "Linear",
    "Moment",
    "Node",
    "Parameter",
    "Port",
    "Ports",
    "Problem",
    "Record",
    "Run",
    "Setting",
    "Signals",
    "Sink",
    "Timeline",
    "dumps",
    "edit",
    "example",
    "extract",
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
# Blocks derived from the parts of learners are reached by name, through `__getattr__`.
__all__ += _blocks.__all__  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(title: str) -> Any:
    """The block of a registered part of a learner by the name of its class, such as `EligibilityTrace`."""
    return getattr(_blocks, title)


def edit(diagram: Diagram | None = None, file: Path | str | None = None) -> "Editor":
    """Open TimLab's editor in a notebook cell, in Jupyter or marimo: the same editor as `motorgrad lab` in a browser.

        editor = mg.lab.edit(mg.lab.example("chain"))  # shown when it is the last value of a cell
        run = mg.lab.Run(editor.diagram)

    **Arguments:**

    - `diagram`: the diagram to begin with; the editor works on a copy. By default the one in `file`, or an empty one.
    - `file`: where the editor saves it.

    **Returns** a widget. Its `diagram` is a copy of the diagram as edited so far; `close` ends the session.

    **Raises** `ValueError` for a file that does not contain a diagram.
    """
    from motorgrad.lab.editor._widget import Editor, Session  # anywidget is loaded only when it is needed

    return Editor(Session(diagram, None if file is None else Path(file).absolute()))
