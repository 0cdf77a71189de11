"""MyoSuite's environments and models, where the extra is installed."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

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


def models() -> list[str]:
    """The names of the models that come with MyoSuite without an environment, such as `myofullbody`: none where it is
    missing or too old."""
    try:
        from myo_sim.build.compose import MODEL_REGISTRY  # pyright: ignore[reportMissingImports]
    except ImportError:
        return []
    return sorted(MODEL_REGISTRY)


def description(name: str) -> Any:
    """The `mujoco.MjSpec` of an environment of MyoSuite, by its id, or of a model, by its name.

    **Raises:** `ValueError` for anything else, and where MyoSuite is missing.
    """
    if name in models():
        return _model(name)
    if not is_of_myosuite(name):
        raise unknown("environment or model of MyoSuite", name, [*ids(), *models()])
    try:
        return environment(name)._mj_spec
    except (OSError, RuntimeError) as error:  # some environments download a motion
        raise ValueError(f"MyoSuite cannot make {name!r}: {' '.join(str(error).split())}") from None


def _model(name: str) -> Any:
    """The description of a model, without the repeated classes of defaults that MuJoCo writes and refuses to read."""
    import mujoco
    from myo_sim.build import compose  # pyright: ignore[reportMissingImports]

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        given: Any = compose.build_spec(name)
        text = compose.sanitize_spec_xml(given.to_xml(), asset_dir=str(compose.ROOT), model=given.compile())
    spec: Any = mujoco.MjSpec.from_string(text)
    files = {each.file for each in (*spec.meshes, *spec.textures) if each.file}
    spec.assets = {file: (compose.ROOT / file).read_bytes() for file in files}
    spec.meshdir = spec.texturedir = ""  # not a place on this machine
    return spec


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
