"""Gymnasium environments by their ids, and by the classes and functions that make them."""

import contextlib
import importlib
import os
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motorgrad._consent import HOW, is_allowed
from motorgrad._errors import MAX_VALUE_CHARACTERS, NotTrusted, check, shown
from motorgrad._myosuite import composing, is_of_myosuite, register

if TYPE_CHECKING:
    import gymnasium

# Stricter than Gymnasium's own pattern, which would take "module:/x" and "a b:x-v0" for modules to import.
_ID = re.compile(r"(?:(?P<module>[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*):)?[\w.-]+(?:/[\w.-]+)?", re.ASCII)

MODEL = "xml_file"
"""The argument by which Gymnasium's environments on MuJoCo are given a model."""
MODELS = (".xml", ".mjcf", ".urdf")
"""How the names of models' files end, by whatever argument they are given."""
MAKERS: dict[str, Callable[..., Any]] = {}
"""The classes and functions that `from_gymnasium` was given in this process, by the ids of their environments."""


def id_of(maker: Callable[..., Any]) -> str:
    """The id `module:name` of the environments that a class or a function makes. It is known from now on.

    **Raises** `ValueError` for one without a name at the top of a module: a run could not say what made it.
    """
    name = getattr(maker, "__qualname__", None)
    module = getattr(maker, "__module__", None)
    named = isinstance(name, str) and isinstance(module, str) and "<" not in name
    wanted = "an id, or a class or a function that is defined at the top of a module, so that a run can name it"
    check(named, "env_id", name or maker, wanted)
    MAKERS[f"{module}:{name}"] = maker
    return f"{module}:{name}"


def module_of(env_id: str) -> str | None:
    """The module that an id `module:name` names; `None` for the id of a registered environment.

    **Raises** `ValueError` for anything else, before it can be taken for another id by another reader.
    """
    found = _ID.fullmatch(env_id) if len(env_id) <= MAX_VALUE_CHARACTERS else None
    check(found, "env_id", env_id, "an id such as 'CartPole-v1', 'module:Name-v0' or 'module:name'")
    assert found is not None
    return found["module"]


def foreign_code(env_id: object, kwargs: object) -> list[str]:
    """The names of code that making an environment would import, and that the user has not named in this process.

    A text among the arguments may be the id of another environment. It counts if it has a colon, since there is no
    telling who will read it.
    """
    texts = [env_id, *(kwargs.values() if isinstance(kwargs, Mapping) else ())]
    return [text for text in texts if isinstance(text, str) and ":" in text and not _is_known(text)]


def _is_known(name: str) -> bool:
    """Whether what a name with a colon stands for was given here, or is registered by a module that is loaded."""
    import gymnasium

    module, _, registered = name.partition(":")
    return is_allowed(name) or name in MAKERS or (module in sys.modules and registered in gymnasium.registry)


def _maker(env_id: str) -> Callable[..., Any] | None:
    """The class or function that an id `module:name` names; `None` for the id of a registered environment."""
    import gymnasium

    if env_id in MAKERS:
        return MAKERS[env_id]
    module = module_of(env_id)
    if module is None:
        return None
    found: Any = importlib.import_module(module)  # which may register the name, too
    name = env_id.partition(":")[2]
    if name in gymnasium.registry:
        return None
    for part in name.split("."):
        found = getattr(found, part, None)
    return found if callable(found) else None


def make_environment(env_id: str, kwargs: Mapping[str, Any]) -> "gymnasium.Env":
    """`gymnasium.make(env_id, **kwargs)`, with any failure as a one-line `ValueError`.

    An id of the form `module:name` may also name a class or a function that returns an environment. This is where it is
    imported, and where that is refused: `NotTrusted` for what neither the user nor Gymnasium's registry knows.
    """
    import gymnasium
    from gymnasium.envs.registration import EnvSpec

    if env_id not in MAKERS:
        module_of(env_id)
    if names := foreign_code(env_id, kwargs):
        raise NotTrusted(
            f"env_id = {shown(env_id)} imports {', '.join(map(shown, names))}, which can do anything; nothing was "
            f"imported. If you trust it: {HOW}",
            names if len(names) == 1 and shown(names[0]) == repr(names[0]) else (),
        )
    try:
        _check_models(kwargs)
    except ValueError as error:
        raise ValueError(f"env_id = {env_id!r}: {error}") from None
    if is_of_myosuite(env_id) and env_id not in gymnasium.registry:
        try:
            register()
        except ValueError as error:
            raise ValueError(f"env_id = {env_id!r}: {error}") from None
    try:
        maker = _maker(env_id)
        with composing(is_of_myosuite(env_id.rpartition(":")[2])):
            return gymnasium.make(env_id if maker is None else EnvSpec(env_id, maker), **kwargs)
    except gymnasium.error.UnregisteredEnv as error:
        raise ValueError(f"env_id = {env_id!r}: {one_line(error)}") from None
    except gymnasium.error.DependencyNotInstalled as error:
        raise ValueError(f"env_id = {env_id!r}: a dependency is not installed: {one_line(error)}") from None
    except ImportError as error:  # Gymnasium's MuJoCo environments raise it without naming a remedy
        raise ValueError(
            f"env_id = {env_id!r}: a dependency is not installed: {one_line(error)}; "
            "for those of Gymnasium: pip install 'gymnasium[mujoco]', or another of its extras"
        ) from None
    except Exception as error:  # an environment's own code may raise anything
        given = f" with {dict(kwargs)}" if kwargs else ""
        raise ValueError(
            f"env_id = {env_id!r}: cannot be made{given}: {type(error).__name__}: {one_line(error)}"
        ) from None


def _check_models(kwargs: Mapping[str, Any]) -> None:
    """Refuse models among the arguments that are beyond the limits of size, as environments have MuJoCo compile them,
    whatever they hold."""
    for name, value in kwargs.items():
        if not isinstance(value, str) or not (name == MODEL or value.lower().endswith(MODELS)):
            continue
        from gymnasium.envs.mujoco.mujoco_env import expand_model_path

        from motorgrad.bodies.models._read import check_file

        files = [os.path.expanduser(value)]
        with contextlib.suppress(OSError):  # there is none
            files.append(expand_model_path(value))
        for file in filter(os.path.exists, dict.fromkeys(files)):
            try:
                check_file(Path(file))
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from None


def one_line(error: BaseException) -> str:
    """An exception's message on one line."""
    return " ".join(str(error).split())
