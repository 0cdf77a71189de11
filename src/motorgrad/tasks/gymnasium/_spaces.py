"""How a policy's output becomes a Gymnasium action, and how Gymnasium observations are scaled."""

import math
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import numpy as np

from motorgrad._errors import choice, shown
from motorgrad._interface import ActionCode, ObservationCode

if TYPE_CHECKING:
    from gymnasium import Space
    from gymnasium.spaces import Box, Discrete, MultiDiscrete


Code = Literal["auto", "choice", "count", "bits", "each", "continuous", "antagonists"]
Scaling = Literal["auto", "bounds", "running", "none"]
CODES = {  # the first is what "auto" stands for
    "Discrete": ("choice", "count", "bits"),
    "MultiDiscrete": ("count", "choice", "bits"),
    "MultiBinary": ("each",),
    "Box": ("continuous", "each", "antagonists"),
}
MAX_ALTERNATIVES = 4096  # of one choice
MAX_UNITS = 65_536
MAX_EXACT_INTEGER = 2**24  # up to which single precision, in which policies compute, has every whole number
USABLE = 1e6  # a bound beyond this carries no information about the observations


def action_code(space: "Space", code: Code, env_id: str) -> ActionCode:
    """The code for an action space. **Raises** `ValueError` for an unsupported space, or a code that does not fit
    it."""
    from gymnasium import spaces

    name = type(space).__name__
    if name not in CODES:
        kinds = ", ".join(CODES)
        refuse_space(env_id, "actions", space, f"{kinds}; gymnasium.wrappers.TransformAction makes one from another")
    choice(f"code for the {name} actions of {env_id}", code, ("auto", *CODES[name]))
    chosen = CODES[name][0] if code == "auto" else code
    if isinstance(space, spaces.Box):
        return _bounds(chosen, space, env_id)
    if isinstance(space, spaces.MultiBinary):
        shape = space.shape
        kind = np.dtype(space.dtype)
        _check_units(chosen, math.prod(shape), env_id, "fewer actions")
        return ActionCode("binary", math.prod(shape), "same", (), shape, kind.name)
    assert isinstance(space, spaces.Discrete | spaces.MultiDiscrete)
    counts = [int(space.n)] if isinstance(space, spaces.Discrete) else [int(n) for n in np.ravel(space.nvec)]
    make = _alternatives if chosen == "choice" else _sums
    return make(chosen, counts, space, env_id)


def _alternatives(code: str, counts: list[int], space: "Discrete | MultiDiscrete", env_id: str) -> ActionCode:
    """One alternative per combination of the action's components."""
    size = math.prod(counts)
    if size > MAX_ALTERNATIVES:
        raise ValueError(
            f"code = {code!r}: {env_id} has {size} combined actions, at most {MAX_ALTERNATIVES}; use 'count'"
        )
    combined = np.stack(np.unravel_index(np.arange(size), counts), axis=-1).astype(space.dtype)
    table = combined + np.ravel(space.start).astype(space.dtype)
    return ActionCode("discrete", size, "choice", (), np.shape(space.start), table.dtype.name, matrix=table)


def _sums(code: str, counts: list[int], space: "Discrete | MultiDiscrete", env_id: str) -> ActionCode:
    """Units for every component of the action, whose weights add up to it: 1 each, or powers of two."""
    if code == "bits" and any(n & (n - 1) for n in counts):
        raise ValueError(
            f"code = 'bits': {env_id} has {counts} actions: must be powers of two; use 'count' or 'choice'"
        )
    lengths = [n.bit_length() - 1 if code == "bits" else n - 1 for n in counts]
    fewer = "'bits', if the numbers of actions are powers of two" if code == "count" else "fewer actions"
    _check_units(code, sum(lengths), env_id, fewer)
    parts = [2 ** np.arange(n)[::-1] if code == "bits" else np.ones(n, int) for n in lengths]
    size = sum(map(len, parts))
    part_of = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    if not size:
        raise ValueError(f"code = {code!r}: {env_id} has a single action, which no unit can choose; use 'choice'")
    weights = np.zeros((size, len(parts)), space.dtype)
    start = np.ravel(space.start).astype(space.dtype)
    weights[np.arange(size), part_of] = np.concatenate(parts)
    return ActionCode("binary", size, "sum", (), np.shape(space.start), weights.dtype.name, matrix=weights, start=start)


def _bounds(code: str, space: "Box", env_id: str) -> ActionCode:
    """Units that are the numbers of the action, or drive them to the bounds of their ranges."""
    low = np.ravel(space.low)
    high = np.ravel(space.high)
    shape = space.shape
    # a space of whole numbers has the ends of its type in place of infinite bounds
    if not (space.is_bounded("both") and np.isfinite(low).all() and np.isfinite(high).all()):
        refuse_space(
            env_id, "actions", space, "a Box with finite bounds; gymnasium.wrappers.TransformAction gives it some"
        )
    _check_units(code, low.size * (1 if code != "antagonists" else 2), env_id, "fewer actions")
    rest = np.clip(0, low, high).astype(low.dtype)
    eye = np.eye(low.size)
    raw: dict[str, Any] = {"shape": shape, "dtype": low.dtype.name, "low": low, "high": high}
    if code == "continuous":
        _check_graded(low, high, low.dtype.kind in "biu", env_id)
        return ActionCode("continuous", low.size, "clip", **raw)
    if code == "each":
        return ActionCode("binary", low.size, "each", **raw)
    pull = np.concatenate([eye[rest < high], -eye[rest > low]])
    return ActionCode("binary", len(pull), "antagonists", **raw, matrix=pull, start=rest)


def _check_graded(low: np.ndarray, high: np.ndarray, whole: bool, env_id: str) -> None:
    """Refuse bounds between which a policy, which computes in single precision, could not choose every number."""
    with np.errstate(over="ignore"):
        wide = high.astype(np.float32) - low.astype(np.float32)
    right = (wide > 0) & np.isfinite(wide)
    wanted = "a low bound below a high one, both of single precision"
    if whole:
        right &= (low >= -MAX_EXACT_INTEGER) & (high <= MAX_EXACT_INTEGER)
        wanted = f"a low bound below a high one, both whole numbers within ±{MAX_EXACT_INTEGER:,}"
    if not right.all():
        number = int(np.flatnonzero(~right)[0])
        given = f"{low[number]} to {high[number]} for number {number} of the actions of {env_id}"
        raise ValueError(f"code = 'continuous': {given}: must be {wanted}; code 'each' takes any finite bounds")


def _check_units(code: str, size: int, env_id: str, fewer: str) -> None:
    if size > MAX_UNITS:
        raise ValueError(f"code = {code!r}: {env_id} needs {size:,} units, at most {MAX_UNITS:,}; use {fewer}")


def observation_code(space: "Space", scaling: Scaling, env_id: str) -> ObservationCode:
    """The scaling for an observation space: of some numbers from their bounds to −1 … 1, and of others by running
    statistics. **Raises** `ValueError` for an unsupported space or scaling."""
    from gymnasium import spaces

    if not isinstance(space, spaces.Box):
        wrapped = isinstance(space, spaces.Dict | spaces.Tuple | spaces.Discrete | spaces.MultiBinary)
        wrapped = wrapped or isinstance(space, spaces.MultiDiscrete)
        hint = "gymnasium.wrappers.FlattenObservation" if wrapped else "gymnasium.wrappers.TransformObservation"
        refuse_space(env_id, "observations", space, f"Box; {hint} makes one of it")
    low = np.ravel(space.low).astype(float)
    high = np.ravel(space.high).astype(float)
    if not low.size:
        refuse_space(env_id, "observations", space, "Box with at least one number")
    different = low.astype(np.float32) < high.astype(np.float32)  # the precision of what is scaled
    usable = (np.abs(low) < USABLE) & (np.abs(high) < USABLE) & different
    if scaling == "bounds" and not usable.all():
        which = np.flatnonzero(~usable).tolist()
        raise ValueError(
            f"scaling = 'bounds': numbers {which} of the observation of {env_id} have no bounds within ±{USABLE:g}; "
            "use 'auto' or 'running'"
        )
    bounded = usable if scaling in ("auto", "bounds") else np.zeros_like(usable)
    running = ~bounded if scaling in ("auto", "running") else np.zeros_like(usable)
    low = np.where(bounded, low, -1.0)
    high = np.where(bounded, high, 1.0)
    centre = (low + high) / 2
    half = (high - low) / 2
    names = tuple(f"input {index}" for index in range(low.size))
    return ObservationCode(names, centre.astype(np.float32), half.astype(np.float32), running, tuple(space.shape))


def refuse_space(env_id: str, what: str, space: object, wanted: str) -> NoReturn:
    """Refuse a space by name."""
    shape = getattr(space, "shape", None)
    kind = shown(space) if shape == () else type(space).__name__ + (f"{shape}" if isinstance(shape, tuple) else "")
    raise ValueError(f"{env_id} has {what} in a {kind} space: must be {wanted}")
