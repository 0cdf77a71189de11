"""The hopper."""

from motorgrad import tasks
from motorgrad.lab.blocks import Body, GrowingGaussians, Hyperplanes, Motoneurons, NamedPolicy, Softmax, World
from motorgrad.lab.diagram import Block, Diagram
from motorgrad.lab.gallery._wiring import learner, map_of, smoothed


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
    learner(diagram, Motoneurons(4, spread=0.5), World("linear-recruitment"), decay=0.0, rate=2e-4)
    smoothed(diagram, "world.error", over=200.0)
    return diagram


def particle() -> Diagram:
    """The diagram of a falling particle."""
    diagram = Diagram(
        tick=tasks.FallingParticle().period,
        title="Falling particle",
        comment="A particle falls through a region of reward, and local units push it to the left or to the right "
        "(section 6.3 of the thesis). The map shows where units are and how wide they have become. Try the layouts R2 "
        "and R3 in the settings of 'world', or a trace that forgets more quickly.",
    )
    units, copies = 8, 2
    policy = NamedPolicy("tiles", 2, units, f"copies = {copies}")
    _learn(diagram, policy, World("particle"), 0.95, (2e-4, 8e-4))
    map_of(diagram, units, tasks.FallingParticle().forces, "world.observation")
    smoothed(diagram, "world.reward", over=50.0)
    return diagram


def orbit() -> Diagram:
    """The diagram of a particle that goes round and round."""
    diagram = Diagram(
        tick=tasks.ParticleOrbit().period,
        title="Orbit",
        comment="A field of force leads a particle round and round; local units widen its orbit, without episodes "
        "(section 6.4.4 of the thesis). Set 'wanted = \"narrow\"' in the settings of 'world' for the contrary.",
    )
    _learn(diagram, NamedPolicy("tiles", 2, 16), World("particle-orbit"), 0.98, (2e-4, 8e-4))
    map_of(diagram, 16, tasks.ParticleOrbit().forces, "world.observation")
    smoothed(diagram, "world.radius", over=50.0)
    return diagram


def constructive_pool() -> Diagram:
    """The diagram of a pool that grows."""
    diagram = Diagram(
        tick=tasks.ParticleOrbit().period,
        title="Constructive pool",
        comment="The orbit again, learnt by a pool that gets its units one by one (section 6.4.3 of the thesis). A new "
        "unit starts wide in the middle and shrinks; the others wait. Watch the ellipses come in the map. Try "
        "'plateau' for 'grows' in the policy: a unit then comes once the reward no longer rises; or let units start "
        "where the particle has been, 'placed = visited'.",
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
    """Local units have one step size for their centres and one for their widths."""
    half = policy.outputs["parameters"].shape[0] // 2
    learner(diagram, policy, world, decay, rate=rates, groups=(half, half))


def chain() -> Diagram:
    """The diagram."""
    diagram = Diagram(
        tick=1.0,
        title="Chain",
        comment="Six states in a row, and a reward at the far end only (figure 4.9 of the thesis). A step is right or "
        "wrong in every state by itself, so the softmax has a weight for each. The longer the chain, the longer the "
        "first reward takes: try 'length = 12' here and in the policy, and 'variant = \"reset\"', where one wrong step "
        "leads back to the start. A decay near 1 credits steps long past.",
    )
    world = World("chain")
    policy = Softmax(world.made.action_size, world.made.observation_size)
    learner(diagram, policy, world, decay=0.9, rate=0.05)
    smoothed(diagram, "world.reward", over=100.0)
    return diagram


def hopper() -> Diagram:
    """The diagram."""
    diagram = Diagram(
        tick=tasks.Hopper().period,
        title="Hopper",
        comment="Two hyperplane units drive the flexors and the extensors of a hopper, and learn to hop (section 5.2 "
        "of the thesis). They see foot contact, knee angle and knee velocity, and are paid the height of a hop when it "
        "lands. Hops begin after some hundred seconds of the hopper's time. Try the thesis's decay of 0.98 in 'trace': "
        "it forgets the push before the landing pays. Then change the body, 'body.load_mass = 3.0', and see it adapt.",
    )
    learner(diagram, Hyperplanes(2, 3), Body("hopper"), decay=0.995, rate=5e-4)
    smoothed(diagram, "world.apex", over=5.0)
    smoothed(diagram, "world.reward", over=20.0)
    return diagram
