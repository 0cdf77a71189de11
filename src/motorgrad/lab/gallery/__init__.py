"""Ready diagrams: the systems of the thesis, to run, take apart and change."""

from collections.abc import Callable

from motorgrad._errors import unknown
from motorgrad.lab._diagram import Diagram
from motorgrad.lab.gallery._chain import chain
from motorgrad.lab.gallery._hopper import hopper
from motorgrad.lab.gallery._leg_controller import leg_controller
from motorgrad.lab.gallery._linear_recruitment import linear_recruitment
from motorgrad.lab.gallery._motoneuron_pool import motoneuron_pool
from motorgrad.lab.gallery._particle import constructive_pool, orbit, particle
from motorgrad.lab.gallery._wiring import learner

GALLERY: dict[str, Callable[[], Diagram]] = {
    "motoneuron-pool": motoneuron_pool,
    "linear-recruitment": linear_recruitment,
    "particle": particle,
    "constructive-pool": constructive_pool,
    "orbit": orbit,
    "chain": chain,
    "hopper": hopper,
    "leg-controller": leg_controller,
}
"""Functions that make the diagrams, by name. A new one is a file and a line here."""


def example(name: str) -> Diagram:
    """The diagram of the gallery called `name`, a new one that may be changed. **Raises** `ValueError` for an unknown
    name, with the nearest."""
    if name not in GALLERY:
        raise unknown("diagram of the gallery", name, GALLERY)
    return GALLERY[name]()


__all__ = ["GALLERY", "example", "learner"]
