"""The state of a Gymnasium environment as plain data, which restores it without running any code.

An environment is a graph of Python objects: wrappers, the environment, and what they hold. Everything there that can
change is written down as JSON: numbers, text, arrays, containers, random generators, and the state of MuJoCo. To
restore it, an environment is made afresh, and these are put in their places. What cannot change in a run, such as a
function or a model, stays as it was made. Anything else, such as an object of a C library, is refused.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import base64
import collections
import copy
import enum
import functools
import hashlib
import json
import logging
import random
import types
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._errors import check
from motorgrad.tasks.gymnasium._state_forms import (
    NUMBERS,
    PLAIN,
    Stored,
    check_form,
    check_random_state,
    check_twister,
    number_type,
    packed,
    unpacked,
)

if TYPE_CHECKING:
    import gymnasium
    import mujoco

BOXES = {"list": list, "set": set, "frozenset": frozenset}
NAMED = (types.ModuleType, types.FunctionType, types.BuiltinFunctionType, types.MethodType, type)
FIXED = (functools.partial, logging.Logger, np.dtype, np.ufunc)
OF_CONTACTS = ("efc_", "iefc_", "efm_", "solver_", "iacc", "ifrc_")  # their sizes vary; a step computes them first
BARE = object.__basicsize__ + 16  # bytes of an object of a class written in Python: a dictionary, weak references


class NoState(ValueError):
    """An environment whose state cannot be written as data, or data that do not fit an environment."""


def write_state(environment: "gymnasium.Env") -> bytes:
    """The state of an environment. **Raises** `NoState` that names what cannot be written."""
    return json.dumps(_Writer().write(environment, ""), separators=(",", ":")).encode()


def read_state(content: bytes, environment: "gymnasium.Env") -> None:
    """Put an environment, made in the same way and reset, into a written state. Runs no code from `content`.

    **Raises:** `NoState` where `content` does not fit the environment, which is then in no useful state.
    """
    try:
        stored = json.loads(content)
        check_form(stored)
        found = _Reader().read(stored, environment)
        same = found is environment and write_state(environment) == content
        check(same, "state", "what was read", "what was written")
    except Exception as error:  # what was damaged may raise anything
        raise NoState(f"the state does not fit the environment: {type(error).__name__}: {error}") from None


class _Writer:
    """What is met a second time is written as a reference to the first, so that one thing stays one thing."""

    def __init__(self) -> None:
        self._met: dict[int, int] = {}
        self._kept: list[Any] = []  # an id is unique only while the object lives

    def write(self, value: object, path: str) -> Any:
        if type(value) in PLAIN:
            return value
        if isinstance(value, np.generic):
            return {"scalar": packed(np.asarray(value))}
        if isinstance(value, enum.Enum):
            return {"enum": value.name}
        if isinstance(value, bytes):
            return {"bytes": base64.b64encode(value).decode()}
        if (identity := _identity(value)) is not None:
            return {"fixed": identity}
        if type(value) is tuple:
            return {"tuple": [self.write(item, f"{path}[{i}]") for i, item in enumerate(value)]}
        if (number := self._met.get(id(value))) is not None:
            return {"met": number}
        self._met[id(value)] = len(self._met)
        self._kept.append(value)
        return self._write_new(value, path)

    def _write_new(self, value: Any, path: str) -> Any:
        kind = type(value)
        if kind is np.ndarray and value.dtype.kind in NUMBERS:
            return self._array(value, path)
        if kind in (list, collections.deque):
            items = [self.write(item, f"{path}[{i}]") for i, item in enumerate(value)]
            return {"list": items} if kind is list else {"deque": items, "most": value.maxlen}
        if kind in (set, frozenset):
            return {kind.__name__: [self.write(item, path) for item in sorted(value, key=repr)]}
        if kind in (dict, collections.OrderedDict, collections.defaultdict):
            items = [[self.write(key, path), self.write(item, f"{path}[{key!r}]")] for key, item in value.items()]
            return {"dict": items}
        if isinstance(value, np.random.Generator):
            return {"generator": self.write(value.bit_generator.state, path)}
        if isinstance(value, np.random.RandomState):
            return {"generator": self.write(value.get_state(legacy=False), path)}
        if isinstance(value, random.Random):
            return {"generator": self.write(value.getstate(), path)}
        if isinstance(value, _mujoco().MjData):
            return {"physics": {name: packed(array) for name, array in _physics(value).items()}}
        fields = _fields(value)
        if fields is None:
            raise NoState(f"{path.lstrip('.') or 'it'} is a {_name(kind)}, whose state cannot be read")
        return {"object": _name(kind), "fields": {n: self.write(v, f"{path}.{n}") for n, v in fields.items()}}

    def _array(self, value: np.ndarray, path: str) -> Any:
        base = value.base
        if base is None:
            return {"array": packed(value)}
        if type(base) is not np.ndarray:  # it shows memory that is not NumPy's
            if value.dtype.kind not in "fb":  # C code may follow what is no measurement
                raise NoState(f"{path.lstrip('.') or 'it'} holds {value.dtype} numbers in memory of a library")
            return {"shared": packed(value)}
        start = value.__array_interface__["data"][0] - base.__array_interface__["data"][0]
        return {"view": [value.dtype.str, start, value.shape, value.strides], "of": self.write(base, f"{path}.base")}


class _Reader:
    """The inverse. `read` returns what belongs in the place of `present`, which it changes if that is an object."""

    def __init__(self) -> None:
        self._met: list[Any] = []

    def read(self, stored: Stored, present: object) -> Any:
        if not isinstance(stored, dict):  # it is plain
            return stored
        form, content = next(iter(stored.items()))
        if form == "scalar":
            return unpacked(content)[()]
        if form == "enum":
            kind: Any = type(present)
            check(isinstance(present, enum.Enum), "state", kind.__name__, "an enumeration")
            return kind[content]
        if form == "bytes":
            return base64.b64decode(content, validate=True)
        if form == "fixed":
            check(_identity(present) == content, "state", _identity(present), content)
            return present
        if form == "tuple":
            return tuple(self._items(content, present))
        if form == "met":
            return self._met[content]
        place = len(self._met)
        self._met.append(present)
        self._met[place] = found = self._read_new(form, content, stored, present, place)
        return found

    def _read_new(self, form: str, content: Any, stored: dict[str, Any], present: object, place: int) -> Any:
        if form == "array":
            return unpacked(content)
        if form == "shared":
            _fill(present, unpacked(content), "an array")
            return present
        if form == "view":
            kind, start, shape, strides = content
            base = self.read(stored["of"], getattr(present, "base", None))
            check(type(base) is np.ndarray and base.dtype.kind in NUMBERS, "base", type(base).__name__, "an array")
            return np.ndarray(shape, number_type(kind), base, start, strides)
        if form in ("list", "deque"):
            made: Any = [] if form == "list" else collections.deque(maxlen=stored["most"])
            self._met[place] = made  # which may hold itself
            made.extend(self._items(content, present))
            return made
        if form in BOXES:
            return BOXES[form](self._items(content, None))
        if form == "dict":
            held = dict(present) if isinstance(present, dict) else {}
            self._met[place] = made = copy.copy(present) if isinstance(present, dict) else {}
            made.clear()
            for key, item in content:
                key = self.read(key, None)
                made[key] = self.read(item, held.get(key))
            return made
        if form == "generator":
            return _with_random_state(present, self.read(content, None))
        if form == "physics":
            return _with_physics(present, {name: unpacked(array) for name, array in content.items()})
        fields = _fields(present)
        wanted = stored["fields"]
        check(fields is not None and _name(type(present)) == content, "state", _name(type(present)), f"a {content}")
        found = {name: self.read(item, vars(present).get(name)) for name, item in wanted.items()}
        for name in fields or ():
            del vars(present)[name]
        vars(present).update(found)  # in the order of the original
        return present

    def _items(self, content: list[Any], present: object) -> list[Any]:
        held = list(present) if isinstance(present, list | tuple | collections.deque) else []
        return [self.read(item, held[i] if i < len(held) else None) for i, item in enumerate(content)]


def _mujoco() -> Any:
    """MuJoCo, once an environment is saved."""
    import mujoco

    return mujoco


def _fields(value: object) -> dict[str, Any] | None:
    """The attributes of an object; `None` for an object that is more than its attributes, such as one made in C."""
    from gymnasium import Space

    cls = type(value)
    if not hasattr(value, "__dict__") or cls.__basicsize__ > BARE or cls.__itemsize__:
        return None
    if any(vars(base).get("__slots__") for base in cls.__mro__):
        return None
    if isinstance(value, Space):  # its bounds are fixed; what it is sampled with is not
        return {name: item for name, item in vars(value).items() if name in ("_np_random", "spaces")}
    return dict(vars(value))


def _identity(value: object) -> str | None:
    """What identifies a thing that cannot change while an environment is used; `None` for others."""
    from gymnasium.envs.registration import EnvSpec

    if isinstance(value, NAMED):
        return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', value.__name__)}"
    if isinstance(value, _mujoco().MjModel):
        return f"MjModel {_model_checksum(value)}"
    return _name(type(value)) if isinstance(value, (*FIXED, EnvSpec)) else None


def _model_checksum(model: "mujoco.MjModel") -> str:
    """A hash of the numbers of a model: an environment that draws another model for each episode is not restored."""
    digest = hashlib.sha256()
    for array in _arrays(model, ("mesh_", "tex_", "bvh_", "skin_")).values():
        digest.update(array.tobytes())
    return digest.hexdigest()[:16]


def _arrays(structure: object, without: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The arrays of real numbers of a structure of MuJoCo, by name.

    Indices are left out: C code follows them, and a step computes them first.
    """
    found = {name: getattr(structure, name) for name in dir(structure) if not name.startswith(("_", *without))}
    return {name: item for name, item in found.items() if isinstance(item, np.ndarray) and item.dtype == float}


def _physics(data: "mujoco.MjData") -> dict[str, np.ndarray]:
    """The state from which MuJoCo integrates, and the numbers that it derived.

    The latter belong to the state before the last step, so they do not follow from the present one. Some environments
    read them before they step.
    """
    mujoco = _mujoco()
    every = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(data.model, every))
    mujoco.mj_getState(data.model, data, state, every)
    return {"state": state, **_arrays(data, OF_CONTACTS)}


def _with_physics(data: "mujoco.MjData", stored: dict[str, np.ndarray]) -> "mujoco.MjData":
    mujoco = _mujoco()
    check(isinstance(data, mujoco.MjData), "state", type(data).__name__, "an MjData")
    found, wanted = (
        {name: (array.shape, array.dtype) for name, array in arrays.items()} for arrays in (stored, _physics(data))
    )
    different = [name for name in found.keys() | wanted.keys() if found.get(name) != wanted.get(name)]
    check(not different, "state of MuJoCo", sorted(different), "of the sizes of this model")
    mujoco.mj_setState(data.model, data, stored.pop("state"), mujoco.mjtState.mjSTATE_INTEGRATION)
    _check_delays(data)
    for name, array in stored.items():
        _fill(getattr(data, name), array, name)
    return data


def _check_delays(data: "mujoco.MjData") -> None:
    """Refuse the places of newest entries in the histories of delayed signals, which C code follows unchecked."""
    model = data.model
    for kind in ("actuator", "sensor"):
        lengths = getattr(model, f"{kind}_history")[:, 0]
        starts = getattr(model, f"{kind}_historyadr")
        delayed = lengths > 0
        places = data.history[starts[delayed] + 1]
        lengths = lengths[delayed]
        right = (places >= 0) & (places < lengths) & (places == np.floor(places))
        check(right.all(), f"{kind}_history", places.tolist(), f"at places within their lengths, {lengths.tolist()}")


def _fill(present: object, array: np.ndarray, name: str) -> None:
    """Write numbers into an array that lives in the memory of a library, of exactly their shape and type."""
    fits = isinstance(present, np.ndarray) and present.shape == array.shape and present.dtype == array.dtype
    check(fits and array.dtype.kind in "fb", name, f"{array.dtype}{array.shape}", "of the shape and type that is there")
    assert isinstance(present, np.ndarray)
    np.copyto(present, array)


def _with_random_state(present: object, state: Any) -> Any:
    if isinstance(present, random.Random):
        check_twister(state[1][:-1])
        present.setstate(state)  # which checks the position
        return present
    check_random_state(state)
    if isinstance(present, np.random.RandomState):
        present.set_state(state)
    else:
        if not isinstance(present, np.random.Generator):
            kinds = {kind.__name__: kind for kind in (np.random.PCG64, np.random.MT19937, np.random.Philox)}
            present = np.random.Generator(kinds[state["bit_generator"]]())
        present.bit_generator.state = state
    return present


def _name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"
