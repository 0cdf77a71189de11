"""The Gymnasium ids of our tasks. Importing this module loads nothing heavy, not even Gymnasium.

Gymnasium 1.0 and later ignore entry points: an id is known once the package that declares it was imported. So `import
motorgrad` registers ours, either immediately or when Gymnasium is imported later.
"""

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

from motorgrad._task_table import TASK_TABLE

if TYPE_CHECKING:
    from importlib.abc import Loader
    from importlib.machinery import ModuleSpec

TASK_OF = {entry.env_id: name for name, entry in TASK_TABLE.items() if entry.env_id is not None}
"""The name of the task behind each id."""

MAX_EPISODE_STEPS = 1_000
"""Default for `make` and `make_vec`: decisions after which an episode is cut; 10 s for the hopper."""


def register() -> None:
    """Register the ids with Gymnasium. Further calls do nothing."""
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
    """Call `register` now if Gymnasium is loaded, else as soon as it is."""
    if "gymnasium" in sys.modules:
        register()
    else:
        sys.meta_path.insert(0, _GymnasiumFinder())


class _GymnasiumFinder:
    """An import finder that wraps Gymnasium's loader, so that our ids are registered when it is loaded. It avoids the
    base classes of `importlib.abc`, whose import takes longer than the rest of `import motorgrad`."""

    _asking = False

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> "ModuleSpec | None":
        if fullname != "gymnasium" or self._asking:
            return None
        self._asking = True
        try:
            spec = find_spec(fullname)
        finally:
            self._asking = False
        if spec is not None and spec.loader is not None:
            spec.loader = cast(Any, _RegisteringLoader(spec.loader, self))
        return spec


class _RegisteringLoader:
    """A loader that wraps another one, and then calls `register`."""

    def __init__(self, loader: "Loader", finder: _GymnasiumFinder):
        self._loader, self._finder = loader, finder

    def create_module(self, spec: "ModuleSpec") -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: Any) -> None:
        module.__spec__.loader = module.__loader__ = self._loader
        if self._finder in sys.meta_path:
            sys.meta_path.remove(self._finder)
        self._loader.exec_module(module)
        register()
