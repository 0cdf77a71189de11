"""The chain with a reward at its far end."""

from motorgrad.lab._diagram import Diagram
from motorgrad.lab.blocks.learning import Softmax
from motorgrad.lab.blocks.worlds import World
from motorgrad.lab.gallery._wiring import learner, smoothed


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
    learner(diagram, policy, world, decay=0.9, learning_rate=0.05)
    smoothed(diagram, "world.reward", over=100.0)
    return diagram
