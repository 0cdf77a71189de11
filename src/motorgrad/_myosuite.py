"""MyoSuite's environments and models, where the extra is installed."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import contextlib
import functools
import re
import sys
import threading
import warnings
from collections.abc import Iterator
from typing import Any

from motorgrad._errors import unknown
from motorgrad._extras import install

_FAMILIES = re.compile(r"myo[A-Z]|motorFinger")
_ATTACHED = re.compile("Attaching a spec with an empty prefix|Attach conflict when attaching")
_composing = threading.RLock()  # handlers and filters of warnings belong to the process


def is_of_myosuite(env_id: str) -> bool:
    """Whether an id looks like an id of MyoSuite."""
    return _FAMILIES.match(env_id) is not None


@contextlib.contextmanager
def composing(of_myosuite: bool = True) -> Iterator[None]:
    """Context in which MyoSuite composes a model, without MuJoCo's warnings of how MyoSuite attaches its parts, which
    are printed, appended to a file in the working folder, and repeated whenever the model is compiled. All other
    warnings are shown. Nothing changes unless `of_myosuite`."""
    if not of_myosuite:
        yield
        return
    import mujoco

    with _composing, warnings.catch_warnings():
        before = mujoco.get_mju_user_warning()

        def tell(message: str) -> None:
            if _ATTACHED.match(message):
                return
            if before is None:
                print(f"WARNING: {message}", file=sys.stderr)  # as MuJoCo prints it
            else:
                before(message)

        warnings.filterwarnings("ignore", _ATTACHED.pattern)
        mujoco.set_mju_user_warning(tell)
        try:
            yield
        finally:
            mujoco.set_mju_user_warning(before)


def register() -> None:
    """Import MyoSuite, which registers its environments with Gymnasium. **Raises** `ValueError` that says how to
    install it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of its own dependencies
            import myosuite  # noqa: F401  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ValueError(f"MyoSuite is not installed ({error}): {install('myosuite')}") from None


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
    """The `mujoco.MjSpec` of an environment of MyoSuite, by its id, or of a model, by its name. **Raises** `ValueError`
    for anything else, and where MyoSuite is missing."""
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

    with composing():
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
    """An environment of MyoSuite without wrappers, for reading: its model and its numbers. **Raises** `ValueError` for
    an id that MyoSuite does not have, and where MyoSuite is missing."""
    import gymnasium

    known = ids()  # which asks for MyoSuite
    if env_id not in known:
        raise unknown("environment of MyoSuite", env_id, known)
    with composing():
        warnings.simplefilter("ignore")
        return gymnasium.make(env_id).unwrapped
