"""The motoneuron pool, with its muscle and its reward in plain blocks."""

from motorgrad.lab._diagram import Diagram
from motorgrad.lab.blocks._formula import Expression
from motorgrad.lab.blocks._noise import UniformNoise
from motorgrad.lab.blocks._unit_delay import UnitDelay
from motorgrad.lab.blocks._vectors import Reduce
from motorgrad.lab.blocks.learning import Motoneurons
from motorgrad.lab.gallery._wiring import connect, learner, smoothed

UNITS = 4


def motoneuron_pool() -> Diagram:
    """The diagram."""
    diagram = Diagram(
        tick=1.0,
        title="Motoneuron pool",
        comment="Four motoneurons see a load and fire or do not; their muscle pulls with as many units as fire. What "
        "is paid is minus the square of how far the force is from the wanted one, 1.2 times the load less 0.1 of the "
        "pool's. Watch the gains grow from 0 and the thresholds move apart. Change the numbers of 'paid', the wanted "
        "slope and intercept, while it runs: the pool learns anew. Freeze 'optimizer' and it does not.",
    )
    diagram.add("load", UniformNoise(low=0.0, high=1.0, shape=(1,)))
    diagram.add("force", Reduce("sum", (UNITS,)))
    diagram.add("seen", Reduce("sum", (1,)))
    wanted = f"{UNITS} * (slope * load + intercept)"
    diagram.add("paid", Expression(f"-(force - {wanted})^2", ("force", "load"), ("slope", "intercept"), (1.2, -0.1)))
    diagram.add("reward", UnitDelay())
    learner(diagram, Motoneurons(UNITS, spread=0.5), None, decay=0.0, learning_rate=2e-4)
    connect(
        diagram,
        ("load", "policy.observation"),
        ("load", "seen"),
        ("policy.action", "force"),
        ("force", "paid.force"),
        ("seen", "paid.load"),
        ("paid", "reward"),
        ("reward", "baseline.reward"),
    )
    smoothed(diagram, "reward", over=200.0)
    return diagram
