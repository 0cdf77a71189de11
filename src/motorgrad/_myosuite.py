"""MyoSuite's environments, where the extra is installed."""

import functools
import re
import warnings
from typing import Any

from motorgrad._errors import unknown

_FAMILIES = re.compile(r"myo[A-Z]|motorFinger")


def is_of_myosuite(env_id: str) -> bool:
    """Whether an id looks like an id of MyoSuite."""
    return _FAMILIES.match(env_id) is not None


def register() -> None:
    """Import MyoSuite, which registers its environments with Gymnasium.

    **Raises:** `ValueError` with the command that installs it.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of its own dependencies
            import myosuite  # noqa: F401  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ValueError(f"MyoSuite is not installed ({error}): pip install '.[myosuite]'") from None


def ids() -> list[str]:
    """The ids of all environments of MyoSuite."""
    import gymnasium

    register()
    return sorted(name for name in gymnasium.registry if is_of_myosuite(name))


@functools.lru_cache(maxsize=32)
def environment(env_id: str) -> Any:
    """An environment of MyoSuite without wrappers, for reading: its model and its numbers.

    **Raises:** `ValueError` for an id that MyoSuite does not have, and where MyoSuite is missing.
    """
    import gymnasium

    known = ids()  # which asks for MyoSuite
    if env_id not in known:
        raise unknown("environment of MyoSuite", env_id, known)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return gymnasium.make(env_id).unwrapped
