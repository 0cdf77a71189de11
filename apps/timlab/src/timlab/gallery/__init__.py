"""Ready diagrams, to run, take apart and change: the systems of the thesis, and others that do not learn."""

from collections.abc import Callable

from motorgrad._arguments import check_arguments
from motorgrad._errors import unknown
from timlab.diagram import Diagram
from timlab.gallery._dynamics import anti_windup, bouncing_ball, lorenz, pendulum, spiking
from timlab.gallery._plain_blocks import leg_controller, motoneuron_pool, spiking_pool
from timlab.gallery._tasks import (
    chain,
    constructive_pool,
    hopper,
    linear_recruitment,
    memory,
    network,
    orbit,
    particle,
)
from timlab.gallery._wiring import learner

GALLERY: dict[str, Callable[[], Diagram]] = {
    "motoneuron-pool": motoneuron_pool,
    "spiking-pool": spiking_pool,
    "linear-recruitment": linear_recruitment,
    "particle": particle,
    "constructive-pool": constructive_pool,
    "orbit": orbit,
    "chain": chain,
    "hopper": hopper,
    "network": network,
    "memory": memory,
    "leg-controller": leg_controller,
    "pid": anti_windup,
    "lorenz": lorenz,
    "ball": bouncing_ball,
    "pendulum": pendulum,
    "spiking": spiking,
}
"""Functions that build the diagrams, by name. A new example is a function and a line here."""


def example(name: str) -> Diagram:
    """A new copy of the gallery's diagram `name`, which may be changed.

    **Raises** `ValueError` for an unknown name, naming the nearest known one.
    """
    check_arguments(example, locals())
    if name not in GALLERY:
        raise unknown("diagram of the gallery", name, GALLERY)
    return GALLERY[name]()


__all__ = ["GALLERY", "example", "learner"]
