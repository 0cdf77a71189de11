"""Linear recruitment."""

from motorgrad.lab._diagram import Diagram
from motorgrad.lab.blocks.learning import Motoneurons
from motorgrad.lab.blocks.worlds import World
from motorgrad.lab.gallery._wiring import learner, smoothed


def linear_recruitment() -> Diagram:
    """The diagram."""
    diagram = Diagram(
        tick=1.0,
        title="Linear recruitment",
        comment="The pool of the diagram before, with the task as one block (section 4.3.1 of the thesis). Its "
        "settings are those of the task: try 'units = 8' there and in the pool, a 'size_ratio' for units of different "
        "strength, or a muscle that tires: 'drift.amount = -0.3'. With 1,000 seeds in one run "
        "the band of the error is narrow.",
    )
    learner(diagram, Motoneurons(4, spread=0.5), World("linear-recruitment"), decay=0.0, learning_rate=2e-4)
    smoothed(diagram, "world.error", over=200.0)
    return diagram
