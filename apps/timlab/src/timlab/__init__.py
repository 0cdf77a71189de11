r"""TimLab: dynamical systems, controllers and learners built from blocks.

    import timlab

    diagram = timlab.Diagram(tick=0.01)
    diagram.add("input", timlab.Constant(1.0))
    diagram.add("error", timlab.Sum("+-"))
    diagram.add("speed", timlab.Gain(2.0))
    diagram.add("level", timlab.Integrator())
    diagram.connect("input", "error.u1")
    diagram.connect("level", "error.u2")
    diagram.connect("error", "speed")
    diagram.connect("speed", "level")

**One tick.** First, all outputs are computed, each block after the blocks it reads from. Then all states advance,
using the inputs of this tick. An input declared with `feedthrough=False` does not affect the outputs of the same tick,
so a block with such an input breaks a loop. Between ticks, continuous blocks are integrated by RK4: they, and every
stateless and deterministic block that they reach without delay, are evaluated again inside the step. Everything else is
evaluated once per tick and held. Steps are split where a source jumps. A `Diagram` chooses its solver: RK4 takes fixed
steps; the others adapt them to the error and locate zero crossings.

To write a block of your own, see the page on TimLab's engine (`docs/lab.md`).
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import timlab.blocks as _blocks
from motorgrad._arguments import check_arguments as _check_arguments
from timlab._analysis import (
    Bode,
    RootLocus,
    StepResponse,
    Trim,
    bode,
    root_locus,
    state_space,
    step_response,
    trim,
)
from timlab.blocks import *  # noqa: F403  (every registered block is exported)
from timlab.compiler import problems
from timlab.diagram import (
    BLOCKS,
    Block,
    Diagram,
    DiagramError,
    Foreign,
    Host,
    HostBlock,
    HostMoment,
    Moment,
    Node,
    Port,
    Ports,
    Problem,
    Record,
    Signals,
    Sink,
    block,
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
    to_svg,
    whole_ticks,
)
from timlab.engine import (
    Change,
    DiagramEnv,
    DiagramPolicy,
    Interpreter,
    Linear,
    Run,
    RunFault,
    Timeline,
    linearise,
    replay,
    unstable_steps,
)
from timlab.fmi import TickProgram, tick_program, write_fmu
from timlab.gallery import GALLERY, example

if TYPE_CHECKING:
    from timlab.editor._widget import Editor

__all__ = [
    "BLOCKS",
    "GALLERY",
    "Block",
    "Bode",
    "Change",
    "Diagram",
    "DiagramEnv",
    "DiagramError",
    "DiagramPolicy",
    "Foreign",
    "Host",
    "HostBlock",
    "HostMoment",
    "Interpreter",
    "Linear",
    "Moment",
    "Node",
    "Port",
    "Ports",
    "Problem",
    "Record",
    "RootLocus",
    "Run",
    "RunFault",
    "Signals",
    "Sink",
    "StepResponse",
    "TickProgram",
    "Timeline",
    "Trim",
    "block",
    "bode",
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
    "root_locus",
    "save",
    "settings_of",
    "state_space",
    "step_response",
    "tick_program",
    "to_html",
    "to_python",
    "to_svg",
    "trim",
    "unstable_steps",
    "whole_ticks",
    "write_fmu",
]
# Blocks derived from the parts of learners are reached by name, through `__getattr__`. The site's tool reads `+=`, and
# cannot follow it.
__all__.extend(_blocks.__all__)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(title: str) -> Any:
    """The block of a registered part of a learner by the name of its class, such as `EligibilityTrace`."""
    return getattr(_blocks, title)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def to_html(diagram: Diagram, record: Record) -> str:
    """A diagram with a recorded run as one HTML page, to be scrubbed through and played again. Anyone can open it in a
    browser; it needs no server and fetches nothing.

        Path("arm.html").write_text(timlab.to_html(diagram, run.advance(1000)), encoding="utf-8")

    **Arguments:** the diagram; a record of a run of it.

    **Raises** `ValueError` in a checkout whose pages are not built.
    """
    _check_arguments(to_html, locals())
    from timlab.editor._page import page_of

    return page_of(diagram, record)


def edit(diagram: Diagram | None = None, file: Path | str | None = None) -> "Editor":
    """Open TimLab's editor in a notebook cell, in Jupyter or marimo: the same editor as `motorgrad lab` in a browser.

        editor = timlab.edit(timlab.example("chain"))  # shown when it is the last value of a cell
        run = timlab.Run(editor.diagram)

    **Arguments:**

    - `diagram`: the diagram to begin with; the editor works on a copy. By default the one in `file`, or an empty one.
    - `file`: where the editor saves it; its name ends in `.json`.

    **Returns** a widget. Its `diagram` is a copy of the diagram as edited so far; `close` ends the session.

    **Raises** `ValueError` for a file that does not contain a diagram, or has another name.
    """
    _check_arguments(edit, locals())
    from timlab.editor._widget import Editor, Session  # anywidget is loaded only when it is needed

    # the page is the notebook's, which runs code anyway
    return Editor(Session(diagram, None if file is None else Path(file).absolute(), trust=True))
