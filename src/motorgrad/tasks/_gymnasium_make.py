"""Making Gymnasium environments, and finding out whether a copy of one goes on as the original."""

import contextlib
import pickle
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import gymnasium

STEPS = 20  # of a trial, before a copy is made and after


def make_environment(env_id: str, kwargs: Mapping[str, Any]) -> "gymnasium.Env":
    """`gymnasium.make(env_id, **kwargs)`; whatever goes wrong is a `ValueError` of one line."""
    import gymnasium

    try:
        return gymnasium.make(env_id, **kwargs)
    except gymnasium.error.UnregisteredEnv as error:
        raise ValueError(f"env_id = {env_id!r}: {_line(error)}") from None
    except gymnasium.error.DependencyNotInstalled as error:
        raise ValueError(f"env_id = {env_id!r}: something that it needs is not installed: {_line(error)}") from None
    except ImportError as error:  # as Gymnasium's MuJoCo environments raise, which name no remedy
        raise ValueError(
            f"env_id = {env_id!r}: something that it needs is not installed: {_line(error)}; "
            "for those of Gymnasium: pip install 'gymnasium[mujoco]', or another of its extras"
        ) from None
    except Exception as error:  # an environment's own code may raise anything
        given = f" with {dict(kwargs)}" if kwargs else ""
        raise ValueError(
            f"env_id = {env_id!r}: cannot be made{given}: {type(error).__name__}: {_line(error)}"
        ) from None


def why_no_copy(env_id: str, kwargs: Mapping[str, Any]) -> str | None:
    """Why an environment cannot be saved and restored; `None` if a restored copy goes on exactly as its original.

    That it can be pickled is not enough: many environments are pickled as what they were made from, without the state
    that they are in. So a copy is made within an episode, and both are stepped.
    """
    original, copy, stage = make_environment(env_id, kwargs), None, "its steps fail"
    try:
        sample = original.action_space.sample
        original.action_space.seed(0)
        original.reset(seed=0)
        for made in range(2 * STEPS):
            _, _, terminated, truncated, _ = original.step(sample())
            if terminated or truncated:
                original.reset()
            elif made >= STEPS:
                break
        stage = "it cannot be serialised"
        copy = restored(saved(original))
        stage = "a restored copy of it fails"
        actions = [sample() for _ in range(STEPS)]
        pairs = zip(_trial(copy, actions), _trial(original, actions), strict=True)
        same = all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)
        return None if same else "a restored copy of it goes on otherwise than the original"
    except Exception as error:  # all of this runs the environment's own code, which may raise anything
        return f"{stage}: {type(error).__name__}: {_line(error)}"
    finally:
        original.close()
        if copy is not None:
            with contextlib.suppress(Exception):  # a copy that is no whole one
                copy.close()


def saved(environment: "gymnasium.Env") -> bytes:
    """An environment as bytes, with the state that it is in.

    It is pickled twice: the bytes also tell which equal parts are one object, which a copy knows less of than its
    original. So the bytes of both are the same.
    """
    import cloudpickle

    return cloudpickle.dumps(pickle.loads(cloudpickle.dumps(environment)))


def restored(content: bytes) -> "gymnasium.Env":
    """The environment that was `saved`. This runs code that the bytes name: restore only what you trust."""
    return pickle.loads(content)


def _trial(environment: "gymnasium.Env", actions: list[Any]) -> list[np.ndarray]:
    """What these actions lead to, and how the next two episodes begin."""
    seen = []
    for action in actions:
        observation, reward, terminated, truncated, _ = environment.step(action)
        seen.append(np.append(np.ravel(observation), (float(reward), terminated, truncated)))
        if terminated or truncated:
            seen.append(np.ravel(environment.reset()[0]))
    return seen + [np.ravel(environment.reset()[0]) for _ in range(2)]


def _line(error: BaseException) -> str:
    """An exception's message on one line."""
    return " ".join(str(error).split())
