"""Diagrams whose world consists of plain blocks: two motoneuron pools, and a leg controller."""

from timlab.blocks import (
    DiscreteIntegrator,
    DiscreteLag,
    Expression,
    Hyperplanes,
    Join,
    Learner,
    Motoneurons,
    Raster,
    Reduce,
    Scope,
    StateMachine,
    UniformNoise,
    UnitDelay,
)
from timlab.diagram import Diagram
from timlab.gallery._wiring import connect, learner, smoothed

UNITS = 4


def motoneuron_pool() -> Diagram:
    """A motoneuron pool, with its muscle and its reward in plain blocks."""
    diagram = Diagram(
        tick=1.0,
        title="Motoneuron pool",
        comment="Four motoneurons observe a load and fire or not; the force of their muscle is the number of "
        "units that fire. The reward is minus the squared deviation from the wanted force, 1.2 times "
        "the load minus 0.1, relative to the pool's largest force. Watch the gains grow from 0 and the "
        "thresholds spread. Change the numbers of 'payoff', the wanted slope and intercept, during a run: "
        "the pool adapts. Freeze 'optimizer' and it does not.",
    )
    diagram.add("load", UniformNoise(low=0.0, high=1.0, shape=(1,)))
    diagram.add("force", Reduce("sum", (UNITS,)))
    diagram.add("seen", Reduce("sum", (1,)))
    wanted = f"{UNITS} * (slope * load + intercept)"
    diagram.add("payoff", Expression(f"-(force - {wanted})^2", ("force", "load"), ("slope", "intercept"), (1.2, -0.1)))
    diagram.add("reward", UnitDelay())
    learner(diagram, Motoneurons(UNITS, spread=0.5), None, decay=0.0, learning_rate=2e-4)
    connect(
        diagram,
        ("load", "policy.observation"),
        ("load", "seen"),
        ("policy.action", "force"),
        ("force", "payoff.force"),
        ("seen", "payoff.load"),
        ("payoff", "reward"),
        ("reward", "baseline.reward"),
    )
    smoothed(diagram, "reward", over=200.0)
    return diagram


SPIKING = 8
# s
HELD = 1.0
TWITCH = 0.05
HEBBIAN = {
    "policy": {"kind": "spiking", "time_constant": 4.0},
    "decay": 0.9,
    "normalization": "root-mean-square",
    "baseline": {"kind": "binned", "bins": 32, "rate": 0.02},
    "learning_rate": 1e-3,
}


def spiking_pool() -> Diagram:
    """Spiking motoneurons that learn to grade a force by a Hebbian rule."""
    many = (SPIKING,)
    diagram = Diagram(
        tick=0.005,
        title="Spiking motoneurons that learn",
        comment=f"{SPIKING} leaky integrate-and-fire motoneurons receive one drive, which is drawn anew every second. "
        "Each spike makes fibres of their muscle twitch. 'pool' is a learner whose score is Hebbian (section 4.1.3 of "
        "the thesis): if reward follows, a weight grows where its input came before a spike, and falls where none "
        "followed. The reward is minus the squared difference from the wanted force. At first every neuron fires in "
        "half of the ticks, whatever the drive is. After some minutes of simulated time the force follows the drive: a "
        "stronger one recruits more of them, and they fire faster. Change 'slope' or 'intercept' of 'wanted' during a "
        "run, and the pool adapts; tick 'frozen' of 'pool', and it does not. With 'time_constant = 0' in its settings "
        "the neurons have no memory.",
    )
    diagram.add("drive", UniformNoise(low=0.0, high=1.0, shape=(1,), period=HELD))
    diagram.add("pool", Learner(1, SPIKING, HEBBIAN))
    diagram.add("recruited", Reduce("mean", many))
    diagram.add("muscle", DiscreteLag(TWITCH))
    diagram.add("seen", Reduce("sum", (1,)))
    diagram.add("wanted", Expression("slope * drive + intercept", ("drive",), ("slope", "intercept"), (0.4, 0.05)))
    # of the actions before this tick: the muscle's output is that of its last inputs
    diagram.add("reward", Expression("-(force - wanted)^2", ("force", "wanted")))
    diagram.add("spikes", Raster(many, window=2.0))
    diagram.add("force over time", Scope(("force", "wanted"), window=10.0))
    connect(
        diagram,
        ("drive", "pool.observation"),
        ("drive", "pool.next_observation"),
        ("drive", "seen"),
        ("seen", "wanted.drive"),
        ("pool.action", "recruited"),
        ("recruited", "muscle"),
        ("muscle", "reward.force"),
        ("wanted", "reward.wanted"),
        ("reward", "pool.reward"),
        ("pool.action", "spikes"),
        ("muscle", "force over time.force"),
        ("wanted", "force over time.wanted"),
    )
    smoothed(diagram, "reward", over=5.0)
    return diagram


LEGS = 2
# rad
BACK = -0.35
FORWARD = 0.35
LIFTED = 0.4
STATES = {"stance": (-3.0, -1.0), "swing": (6.0, 6.0), "drop": (0.0, -6.0)}  # rad/s: lateral, vertical


def leg_controller() -> Diagram:
    """Two legs, a state machine for each, and units that learn when to lift."""
    diagram = Diagram(
        tick=0.02,
        title="Tripod leg controller",
        comment="One leg for each tripod of a hexapod, driven by a state machine as in figure 5.7 of the thesis: "
        "in stance it pushes back, in swing it moves forward in the air, in drop it comes down. When to "
        "lift is not fixed: two units learn it from the positions of both legs and from which of them "
        "stand. The reward is the speed of the body, the mean push of the standing legs; a leg at its end"
        " stop brakes, and while no leg stands the body has fallen, which is penalised. At first legs are"
        " lifted at random. Finally they step in turn: each lifts when it is at the back and the other "
        "has come down. One seed in twenty never lifts one leg. Change the table of velocities during a "
        "run, or the penalty of a fall in 'payoff'.",
    )
    legs = (LEGS,)
    machine = StateMachine(
        states=tuple(STATES),
        transitions=(
            ("stance", "lift > 0", "swing"),
            ("swing", f"lateral >= {FORWARD}", "drop"),
            ("drop", "vertical <= 0", "stance"),
        ),
        reads=("lift", "lateral", "vertical"),
        gives=("turn", "raise"),
        table=tuple(STATES.values()),
        initial=("stance", "drop"),
        shape=legs,
    )
    diagram.add("legs", machine)
    diagram.add("lateral", DiscreteIntegrator(low=BACK, high=FORWARD, limited=True, shape=legs))
    diagram.add("vertical", DiscreteIntegrator(low=0.0, high=LIFTED, limited=True, shape=legs))
    diagram.add("stands", Expression("if(state == 0, 1, 0)", ("state",), shape=legs))
    diagram.add("pushes", Expression(f"if(lateral > {BACK + 0.01:g}, stands, 0)", ("stands", "lateral"), shape=legs))
    diagram.add("angles", Expression("4 * lateral", ("lateral",), shape=legs))
    diagram.add("seen", Join((LEGS, LEGS)))
    diagram.add("pushing", Reduce("sum", legs))
    diagram.add("standing", Reduce("sum", legs))
    payoff = "pushing / max(standing, 1) - if(standing < 1, fall, 0)"
    diagram.add("payoff", Expression(payoff, ("pushing", "standing"), ("fall",), 1.0))
    diagram.add("reward", UnitDelay())
    learner(diagram, Hyperplanes(LEGS, 2 * LEGS), None, decay=0.95, learning_rate=0.02)
    connect(
        diagram,
        ("legs.turn", "lateral.u"),
        ("legs.raise", "vertical.u"),
        ("lateral", "legs.lateral"),
        ("vertical", "legs.vertical"),
        ("legs.state", "stands.state"),
        ("stands", "pushes.stands"),
        ("lateral", "pushes.lateral"),
        ("lateral", "angles"),
        ("angles", "seen.u1"),
        ("stands", "seen.u2"),
        ("seen", "policy.observation"),
        ("policy.action", "legs.lift"),
        ("pushes", "pushing"),
        ("stands", "standing"),
        ("pushing", "payoff.pushing"),
        ("standing", "payoff.standing"),
        ("payoff", "reward"),
        ("reward", "baseline.reward"),
    )
    diagram.add("gait", Scope(("lateral", "stands"), shape=legs, window=4.0))
    connect(diagram, ("lateral", "gait.lateral"), ("stands", "gait.stands"))
    smoothed(diagram, "reward", over=4.0)
    return diagram
