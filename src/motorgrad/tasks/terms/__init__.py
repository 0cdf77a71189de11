"""The terms of composed tasks: what is observed, aimed at, rewarded and recorded, where episodes begin and end.

A term is a small frozen class under `Observation`, `Target`, `Quantity` or `Reset`, and a line of the registry below,
which gives it its name in TOML. `motorgrad.tasks.compose` puts terms together.
"""

from motorgrad._errors import check
from motorgrad._tree import KINDS, Part
from motorgrad.tasks.terms._observations import (
    Activations,
    Clock,
    Contacts,
    JointPositions,
    JointVelocities,
    MuscleForces,
    MuscleLengths,
    MuscleVelocities,
    Positions,
    PreviousAction,
    SensorReadings,
    TargetError,
    TargetPosition,
    Velocities,
)
from motorgrad.tasks.terms._quantities import (
    Alive,
    Along,
    Beyond,
    Closeness,
    Distance,
    Effort,
    Fatigue,
    Height,
    Outside,
    Speed,
    Success,
    Upright,
    Within,
)
from motorgrad.tasks.terms._resets import Keyframe, Noise, RandomJoints
from motorgrad.tasks.terms._targets import Follow, Pose, Reach
from motorgrad.tasks.terms._term import (
    Bound,
    BoundReset,
    BoundTarget,
    Now,
    Observation,
    Quantity,
    Reset,
    Scene,
    Target,
)

KINDS.update(
    {
        Observation: {
            "activations": Activations,
            "clock": Clock,
            "contacts": Contacts,
            "joint-positions": JointPositions,
            "joint-velocities": JointVelocities,
            "muscle-forces": MuscleForces,
            "muscle-lengths": MuscleLengths,
            "muscle-velocities": MuscleVelocities,
            "positions": Positions,
            "previous-action": PreviousAction,
            "sensors": SensorReadings,
            "target": TargetPosition,
            "target-error": TargetError,
            "velocities": Velocities,
        },
        Quantity: {
            "alive": Alive,
            "along": Along,
            "beyond": Beyond,
            "closeness": Closeness,
            "distance": Distance,
            "effort": Effort,
            "fatigue": Fatigue,
            "height": Height,
            "outside": Outside,
            "speed": Speed,
            "success": Success,
            "upright": Upright,
            "within": Within,
        },
        Reset: {"keyframe": Keyframe, "noise": Noise, "random-joints": RandomJoints},
        Target: {"follow": Follow, "pose": Pose, "reach": Reach},
    }
)


def register(base: type[Part], name: str, term: type[Part]) -> None:
    """Give a term of your own a name, by which TOML files and saved runs know it.

    **Arguments:** the `base` class that it derives from: `Observation`, `Target`, `Quantity` or `Reset`; the `name`;
    the class.

    **Raises:** `ValueError` for another base, a name that is taken, or a class that does not derive from `base`.

    ```python
    mg.tasks.terms.register(mg.tasks.terms.Quantity, "my-term", MyTerm)
    ```
    """
    bases = (Observation, Target, Quantity, Reset)
    check(base in bases, "base", base, f"one of {', '.join(each.__name__ for each in bases)}")
    check(isinstance(term, type) and issubclass(term, base), "term", term, f"a class that derives from {base.__name__}")
    taken = KINDS[base].get(name, term)
    check(taken is term, "name", name, f"another name: it is that of {getattr(taken, '__name__', taken)}")
    KINDS[base][name] = term


__all__ = [
    "Activations",
    "Alive",
    "Along",
    "Beyond",
    "Bound",
    "BoundReset",
    "BoundTarget",
    "Clock",
    "Closeness",
    "Contacts",
    "Distance",
    "Effort",
    "Fatigue",
    "Follow",
    "Height",
    "JointPositions",
    "JointVelocities",
    "Keyframe",
    "MuscleForces",
    "MuscleLengths",
    "MuscleVelocities",
    "Noise",
    "Now",
    "Observation",
    "Outside",
    "Pose",
    "Positions",
    "PreviousAction",
    "Quantity",
    "RandomJoints",
    "Reach",
    "Reset",
    "Scene",
    "SensorReadings",
    "Speed",
    "Success",
    "Target",
    "TargetError",
    "TargetPosition",
    "Upright",
    "Velocities",
    "Within",
    "register",
]
