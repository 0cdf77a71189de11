"""What a foreign environment returns, checked before it becomes numbers.

A refusal names what came and what is wanted, in one line; whoever steps the environment adds its name and the step.
"""

import math
import numbers
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motorgrad._errors import check

MAX_SINGLE_PRECISION = float(np.finfo(np.float32).max)
_REALS = (float, bool, np.floating)  # what needs no closer look
_REALS_AND_OTHERS = (*_REALS, numbers.Real)
_FLAGS = frozenset({bool, np.bool_})
_NUMBERS = "biuf"  # kinds of NumPy's types


def step_outcome(returned: object, keys: Sequence[str]) -> tuple[Any, float, bool, bool, Sequence[float]]:
    """What `step` returned, with the numbers of these keys of `info` in its place (`info_numbers`).

    Whether the observation is right is left to `stacked`, for all environments at once. A reward may be infinite or
    not a number.

    **Raises** `ValueError` for anything but an observation, a real number, two flags and a dictionary.
    """
    # once per step, so that what is usual takes a look at its type alone
    if type(returned) is not tuple or len(returned) != 5:
        five = isinstance(returned, tuple | list) and len(returned) == 5
        check(five, "step returned", returned, "an observation, a reward, terminated, truncated and an info")
        assert isinstance(returned, tuple | list)
    observation, reward, terminated, truncated, info = returned
    if type(reward) is not float:
        reward = _real("reward", reward)
    if type(terminated) not in _FLAGS:
        terminated = _flag("terminated", terminated)
    if type(truncated) not in _FLAGS:
        truncated = _flag("truncated", truncated)
    if type(info) is not dict:
        check(isinstance(info, Mapping), "info", info, "a dictionary")
    return observation, reward, terminated, truncated, info_numbers(info, keys) if keys else ()


def first_observation(returned: object, shape: tuple[int, ...]) -> np.ndarray:
    """The observation that `reset` returned. **Raises** `ValueError` unless it is of this shape, and finite."""
    two = isinstance(returned, tuple | list) and len(returned) == 2
    check(two, "reset returned", returned, "an observation and an info")
    assert isinstance(returned, tuple | list)
    observation, info = returned
    check(isinstance(info, Mapping), "info", info, "a dictionary")
    with np.errstate(over="ignore"):  # what is too large becomes infinite
        seen = _observation(observation, shape).astype(np.float32)
    check(np.isfinite(seen).all(), "observation", observation, "finite in single precision")
    return seen


def stacked(seen: Sequence[Any], shape: tuple[int, ...]) -> np.ndarray | None:
    """The observations of all environments along a leading axis; `None` if any is not of this shape, or no numbers."""
    try:
        found = np.asarray(seen)
    except Exception:  # different shapes, or what cannot become an array
        return None
    return found if found.shape[1:] == shape and found.dtype.kind in _NUMBERS else None


def misfit(observation: object, shape: tuple[int, ...]) -> ValueError | None:
    """The error for an observation that is not of this shape, or no numbers; `None` for any other."""
    try:
        _observation(observation, shape)
    except ValueError as error:
        return error
    return None


def info_numbers(info: Mapping[str, Any], keys: Sequence[str]) -> list[float]:
    """The numbers of these keys of a step's `info`, 0 where one is missing, `None` or not finite; then 1 for each that
    is there, else 0. **Raises** `ValueError` for what is not one number or flag."""
    values = []
    for key in keys:
        value = info.get(key)
        found = math.nan if value is None else one_number(value)
        if found is None:
            check(False, f"info[{key!r}]", value, "one number or flag, or None")
        values.append(found)
    there = [abs(value) <= MAX_SINGLE_PRECISION for value in values]  # false for what is not a number
    rounded = [float(np.float32(value)) if known else 0.0 for value, known in zip(values, there, strict=True)]
    return rounded + [float(known) for known in there]


def one_number(value: object) -> float | None:
    """A number, a flag, or an array of one; `None` for anything else."""
    if isinstance(value, _REALS):
        return float(value)
    array = _array(value)
    return float(array.item()) if array is not None and array.size == 1 and array.dtype.kind in _NUMBERS else None


def _real(name: str, value: object) -> float:
    try:
        if isinstance(value, _REALS_AND_OTHERS):
            return float(value)
    except OverflowError:  # a whole number of hundreds of digits
        check(False, name, value, "a real number of double precision")
    array = _array(value)
    right = array is not None and array.ndim == 0 and array.dtype.kind in _NUMBERS
    check(right, name, value, "one real number")
    assert array is not None
    return float(array.item())


def _flag(name: str, value: object) -> bool:
    array = _array(value)
    right = array is not None and array.ndim == 0 and array.dtype.kind in _NUMBERS and array.item() in (0, 1)
    check(right, name, value, "true or false")
    return bool(value)


def _observation(observation: object, shape: tuple[int, ...]) -> np.ndarray:
    array = _array(observation)
    wanted = f"numbers of shape {shape}, as the observation space has"
    check(array is not None, "observation", observation, wanted)
    assert array is not None
    if not (array.shape == shape and array.dtype.kind in _NUMBERS):
        name = f"observation of shape {array.shape} and type {array.dtype}"
        check(False, name, observation, wanted)
    return array


def _array(value: object) -> np.ndarray | None:
    try:
        return np.asarray(value)
    except Exception:  # lists of different lengths; another library's array, whose conversion may raise anything
        return None
