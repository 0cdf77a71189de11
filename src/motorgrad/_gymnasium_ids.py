"""The Gymnasium ids of our tasks. Nothing heavy loads here, Gymnasium itself included.

Gymnasium 1.0 and later read no entry points: an id is known once the package that has it was imported. So `import
motorgrad` makes ours known, at once or, where Gymnasium is imported later, then.
"""

import sys
from importlib.util import find_spec
from typing import Any, cast

TASK_OF = {
    "motorgrad/ArmRecruitment-v0": "arm-recruitment",
    "motorgrad/CallAdmission-v0": "call-admission",
    "motorgrad/Chain-v0": "chain",
    "motorgrad/Hexapod-v0": "hexapod",
    "motorgrad/HexapodPrimitive-v0": "hexapod-primitive",
    "motorgrad/HexapodStride-v0": "hexapod-stride",
    "motorgrad/HexapodSynergy-v0": "hexapod-synergy",
    "motorgrad/Hopper-v0": "hopper",
    "motorgrad/LinearRecruitment-v0": "linear-recruitment",
    "motorgrad/Particle-v0": "particle",
    "motorgrad/ParticleNavigation-v0": "particle-navigation",
    "motorgrad/ParticleOrbit-v0": "particle-orbit",
    "motorgrad/ThreeState-v0": "three-state",
}
"""The task behind each id, by its name in `motorgrad.tasks.TASKS`; a test holds the two together."""

MAX_EPISODE_STEPS = 1_000
"""Decisions after which an episode is cut unless `make` or `make_vec` is told otherwise: 10 s of the hopper."""


def register() -> None:
    """Make the ids known to Gymnasium; a second time does nothing."""
    from gymnasium.envs import registration

    for name, task in TASK_OF.items():
        if name not in registration.registry:
            registration.register(
                name,
                entry_point="motorgrad.environments:TaskEnv",
                vector_entry_point="motorgrad.environments:TaskVectorEnv",
                max_episode_steps=MAX_EPISODE_STEPS,
                kwargs={"task": task},
            )


def register_with_gymnasium() -> None:
    """`register` now where Gymnasium is loaded, else as soon as it is: we do not load it unasked."""
    if "gymnasium" in sys.modules:
        register()
    else:
        sys.meta_path.insert(0, _Waiting())


class _Waiting:
    """A finder of Gymnasium alone, until that is loaded, so that its loader registers.

    Without the base classes of `importlib.abc`: importing them takes longer than the rest of `import motorgrad`.
    """

    _asking = False

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> Any:
        if fullname != "gymnasium" or self._asking:
            return None
        self._asking = True
        try:
            spec = find_spec(fullname)
        finally:
            self._asking = False
        if spec is not None and spec.loader is not None:
            spec.loader = cast(Any, _Registering(spec.loader, self))
        return spec


class _Registering:
    """Another loader, and then `register`."""

    def __init__(self, loader: Any, finder: _Waiting):
        self._loader, self._finder = loader, finder

    def create_module(self, spec: Any) -> Any:
        return self._loader.create_module(spec)

    def exec_module(self, module: Any) -> None:
        module.__spec__.loader = module.__loader__ = self._loader
        if self._finder in sys.meta_path:
            sys.meta_path.remove(self._finder)
        self._loader.exec_module(module)
        register()
