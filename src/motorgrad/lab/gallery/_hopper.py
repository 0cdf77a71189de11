"""The hopper."""

from motorgrad import tasks
from motorgrad.lab._diagram import Diagram
from motorgrad.lab.blocks.learning import Hyperplanes
from motorgrad.lab.blocks.worlds import Body
from motorgrad.lab.gallery._wiring import learner, smoothed


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
    learner(diagram, Hyperplanes(2, 3), Body("hopper"), decay=0.995, learning_rate=5e-4)
    smoothed(diagram, "world.apex", over=5.0)
    smoothed(diagram, "world.reward", over=20.0)
    return diagram
