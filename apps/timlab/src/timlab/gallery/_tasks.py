"""Diagrams of units wired to a task block: recruitment, particles, the chain, loads, the hopper."""

from motorgrad import tasks
from timlab.blocks import (
    Body,
    GrowingGaussians,
    Hyperplanes,
    Motoneurons,
    NamedPolicy,
    Network,
    Raster,
    Scope,
    Select,
    Softmax,
    World,
)
from timlab.diagram import Block, Diagram
from timlab.gallery._wiring import connect, learner, map_of, smoothed


def linear_recruitment() -> Diagram:
    """Linear recruitment: the task as one block."""
    diagram = Diagram(
        tick=1.0,
        title="Linear recruitment",
        comment="The motoneuron pool again, with the task as one block (section 4.3.1 of the thesis). Its "
        "settings are those of the task: try 'units = 8' there and in the pool, a 'size_ratio' for units "
        "of different strength, or a muscle that tires: 'drift.amount = -0.3'. With 1,000 seeds in one "
        "run the band of the error is narrow.",
    )
    learner(diagram, Motoneurons(4, spread=0.5), World("linear-recruitment"), decay=0.0, learning_rate=2e-4)
    smoothed(diagram, "world.error", over=200.0)
    return diagram


def particle() -> Diagram:
    """A falling particle and local units."""
    diagram = Diagram(
        tick=tasks.FallingParticle().period,
        title="Falling particle",
        comment="A particle falls through a region of reward, and local units push it to the left or to the right"
        " (section 6.3 of the thesis). The map shows the units' centres and widths. Try the layouts R2 "
        "and R3 in the settings of 'world', or a trace with a smaller decay.",
    )
    units = 8
    copies = 2
    policy = NamedPolicy("tiles", 2, units, f"copies = {copies}")
    _learn(diagram, policy, World("particle"), 0.95, (2e-4, 8e-4))
    map_of(diagram, units, tasks.FallingParticle().forces, "world.observation")
    smoothed(diagram, "world.reward", over=50.0)
    return diagram


def orbit() -> Diagram:
    """An orbiting particle, without episodes."""
    diagram = Diagram(
        tick=tasks.ParticleOrbit().period,
        title="Orbit",
        comment="A force field drives a particle in circles; local units widen its orbit, without episodes "
        "(section 6.4.4 of the thesis). Set 'wanted = \"narrow\"' in the settings of 'world' to narrow it "
        "instead.",
    )
    _learn(diagram, NamedPolicy("tiles", 2, 16), World("particle-orbit"), 0.98, (2e-4, 8e-4))
    map_of(diagram, 16, tasks.ParticleOrbit().forces, "world.observation")
    smoothed(diagram, "world.radius", over=50.0)
    return diagram


def constructive_pool() -> Diagram:
    """The orbit, learned by a pool that gets its units one by one."""
    diagram = Diagram(
        tick=tasks.ParticleOrbit().period,
        title="Constructive pool",
        comment="The orbit again, learned by a pool that grows one unit at a time (section 6.4.3 of the thesis). "
        "A new unit starts wide in the middle and shrinks while the others are frozen. Watch the ellipses"
        " in the map. Try 'plateau' for 'criterion' in the policy: a unit is then added when the reward stops"
        " rising; or let units start at visited positions of the particle, 'placement = visited'.",
    )
    units = 8
    policy = GrowingGaussians(units, 2, height=0.5, limits=None)
    _learn(diagram, policy, World("particle-orbit", {"units": units}), 0.98, (1e-4, 5e-4))
    diagram.connect("world.reward", "policy.reward")
    diagram.connect("world.valid", "policy.valid")
    map_of(diagram, units, tasks.ParticleOrbit().forces, "world.observation", grows=True)
    smoothed(diagram, "world.radius", over=50.0)
    return diagram


def _learn(diagram: Diagram, policy: Block, world: Block, decay: float, rates: tuple[float, float]) -> None:
    """Add a learner for local units, which have one step size for their centres and one for their widths."""
    half = policy.outputs["parameters"].shape[0] // 2
    learner(diagram, policy, world, decay, learning_rate=rates, groups=(half, half))


def chain() -> Diagram:
    """A chain of states with a reward at its far end."""
    diagram = Diagram(
        tick=1.0,
        title="Chain",
        comment="Six states in a row, with a reward at the far end only (figure 4.9 of the thesis). The right "
        "action depends on the state, so the softmax has weights for each one. The longer the chain, the "
        "later the first reward: try 'length = 12' in 'world' with a policy to match, or 'variant = "
        '"reset"\', where one wrong step leads back to the start. A decay near 1 credits actions long '
        "past.",
    )
    world = World("chain")
    policy = Softmax(world.instance.action_size, world.instance.observation_size)
    learner(diagram, policy, world, decay=0.9, learning_rate=0.05)
    smoothed(diagram, "world.reward", over=100.0)
    return diagram


def network() -> Diagram:
    """The chain, learned by a network."""
    diagram = Diagram(
        tick=1.0,
        title="Network",
        comment="The chain again, with eight hidden units between what is seen and what is done. All weights learn "
        "by the score of the network. The scope shows the hidden units: each comes to respond to some of the "
        "states. Try more layers in the settings of 'policy': 'hidden = (8, 8)'.",
    )
    world = World("chain")
    seen, actions = world.instance.observation_size, world.instance.action_size
    policy = Network("softmax", seen, actions, hidden=(8,), activation="tanh", sparsity=0.0)
    learner(diagram, policy, world, decay=0.9, learning_rate=0.05)
    smoothed(diagram, "world.reward", over=100.0)
    diagram.add("hidden units", Scope(("hidden",), shape=(8,), window=60.0))
    diagram.connect("policy.hidden", "hidden units")
    return diagram


def memory() -> Diagram:
    """Loads carried along a line, by a learner that must remember whether it has one."""
    diagram = Diagram(
        tick=1.0,
        title="Memory",
        comment="A walker picks up loads at the left end of a line and is rewarded when it brings one to the right "
        "end. Between the ends it sees neither where it is nor whether it has a load, so it must remember. The policy "
        "is a finite-state controller: at every tick it draws its next internal state, then its action, and learns "
        "both. Without a memory it would earn at most 0.031 a tick. After some 30,000 ticks it earns almost 0.125, "
        "one load every eight ticks. The raster has a row for each internal state: by then some states mean a load, "
        "and others none. Set 'greedy' of 'policy' during a run: no trip fails. With a 'decay' of 0.5 in 'trace' "
        "nothing is learned: a trip is longer than that. With 'length = 8' in the settings of 'world', learning takes "
        "four times as long.",
    )
    world = World("load-unload")
    states = 4
    seen, actions = world.instance.observation_size, world.instance.action_size
    settings = {"states": states, "strength": 1.0, "output": "softmax"}
    policy = NamedPolicy("finite-state-controller", seen, actions, settings)
    learner(diagram, policy, world, decay=0.95, learning_rate=0.1)
    smoothed(diagram, "world.reward", over=200.0)
    diagram.add("internal states", Raster((states,), window=60.0))
    diagram.add("state", Select(1))
    diagram.add("state and reward", Scope(("state", "reward"), window=60.0))
    connect(
        diagram,
        ("policy.memory", "internal states"),
        ("policy.hidden", "state"),
        ("state", "state and reward.state"),
        ("world.reward", "state and reward.reward"),
    )
    return diagram


def hopper() -> Diagram:
    """The hopper."""
    diagram = Diagram(
        tick=tasks.Hopper().period,
        title="Hopper",
        comment="Two hyperplane units drive the flexors and the extensors of a hopper, and learn to hop (section "
        "5.2 of the thesis). They observe foot contact, knee angle and knee velocity, and are rewarded "
        "with the height of a hop when it lands. Hopping begins after some hundred simulated seconds. Try"
        " the thesis's decay of 0.98 in 'trace': it forgets the push before the landing is rewarded. Then"
        " change the body, 'body.load_mass = 3.0', and watch it adapt.",
    )
    learner(diagram, Hyperplanes(2, 3), Body("hopper"), decay=0.995, learning_rate=5e-4)
    smoothed(diagram, "world.apex", over=5.0)
    smoothed(diagram, "world.reward", over=20.0)
    return diagram
