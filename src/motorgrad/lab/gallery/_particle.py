"""A falling particle and local units; and units that come one by one."""

from motorgrad import tasks
from motorgrad.lab._block import Block
from motorgrad.lab._diagram import Diagram
from motorgrad.lab.blocks.learning import GrowingGaussians, NamedPolicy
from motorgrad.lab.blocks.worlds import World
from motorgrad.lab.gallery._wiring import learner, map_of, smoothed


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
        "'plateau' for 'criterion' in the policy: a unit then comes once the reward no longer rises. Or let units "
        "start where the particle has been, 'placement = visited'.",
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
    """Wire local units, with one learning rate for their centres and one for their widths."""
    half = policy.outputs["parameters"].shape[0] // 2
    learner(diagram, policy, world, decay, learning_rate=rates, groups=(half, half))
