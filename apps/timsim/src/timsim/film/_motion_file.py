"""Stored motions and activations: from NumPy, CSV and OpenSim's files, by the names of joints and muscles."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, shown, unknown
from motorgrad._limits import MAX_MODEL_BYTES, MAX_MOTION_BYTES
from motorgrad._reading import array_in, arrays_in, content_of, numbers_in
from timsim.film._motion import Motion

if TYPE_CHECKING:
    import mujoco

MOTION_SUFFIXES = (".npz", ".npy", ".csv", ".mot", ".sto")
RATE = 100.0
"""Rows a second of an array without times."""
TIME = ("time", "t", "seconds")
_STATES = ("/jointset/", "/forceset/")
"""How OpenSim's names begin in a file of states."""


class Columns(NamedTuple):
    """What a file holds: `time` `(n,)` s; `names` of the columns of `values` `(n, names)`, none where the file has
    none; whether angles are in degrees; `activation` `(n, nu)`, where it is told by an array of its own."""

    time: np.ndarray
    names: tuple[str, ...] | None
    values: np.ndarray
    degrees: bool = False
    activation: np.ndarray | None = None


def read_motion(path: Path | str, model: mujoco.MjModel, partial: bool = False) -> Motion:
    """A stored motion of a model, by the names of its joints.

    | file | contents |
    |---|---|
    | `.mot`, `.sto` | of OpenSim or SIMM: a header, then named columns; with `inDegrees=yes` angles are in degrees |
    | `.csv` | a line of names, then numbers; the column `time` in s |
    | `.npz` | `time` in s and an array for each joint; or `qpos` `(n, nq)` and `time`, and `activation` `(n, nu)` |
    | `.npy` | `qpos` `(n, nq)`, 100 rows a second |

    Angles are in rad, unless the file says otherwise, and lengths in m. A free joint has the columns `NAME 1` to
    `NAME 7`: x, y, z in m, then the quaternion. Joints that the model ties to others by an equality follow these.
    Columns that are named after muscles and other actuators are their activations, in [0, 1].

    **Arguments:** `path`; `model`; `partial`: joints without a column stay where they are at the start, and columns
    that the model does not know are left out. Otherwise both are errors.

    **Raises** `ValueError` that names the file, and the columns that are unknown or missing.

    ```py
    motion = timsim.read_motion("walk.mot", model)
    timsim.view(model, motion=motion)
    ```
    """
    check_arguments(read_motion, locals())
    path = Path(path)
    try:
        return _motion(_columns(path, model), model, partial, path.stem)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def read_activations(path: Path | str, model: mujoco.MjModel) -> tuple[np.ndarray, list[int], np.ndarray]:
    """Recorded activations or controls of a model's muscles and other actuators, in the files of `read_motion`.

    **Returns** the times `(n,)` in s, the numbers of the actuators, and the values `(n, actuators)`. A `.npy` file
    holds `(n, nu)`, 100 rows a second.

    **Raises** `ValueError` that names the file, and the columns that are unknown.
    """
    check_arguments(read_activations, locals())
    path = Path(path)
    try:
        found = _columns(path, model)
        if found.activation is not None:
            check(found.activation.shape[1] == model.nu, "activation", found.activation.shape, f"{model.nu} columns")
            return found.time, list(range(model.nu)), found.activation
        known = {model.actuator(i).name: i for i in range(model.nu)}
        if found.names is None:
            check(found.values.shape[1] == model.nu, "columns", found.values.shape[1], f"{model.nu}, one an actuator")
            return found.time, list(range(model.nu)), found.values
        joints = _coordinates(model)
        wrong = [name for name in found.names if name not in known and name not in joints]
        if wrong:
            raise unknown("muscle", wrong[0], known) if len(wrong) == 1 else ValueError(_listed("unknown", wrong))
        _check_finite(found, known)
        places = [place for place, name in enumerate(found.names) if name in known]
        check(places, "columns", list(found.names), "the names of muscles")
        return found.time, [known[found.names[place]] for place in places], found.values[:, places]
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _motion(found: Columns, model: mujoco.MjModel, partial: bool, label: str) -> Motion:
    import mujoco

    activation = np.zeros((len(found.time), model.nu)) if found.activation is None else found.activation
    if found.names is None:
        check(found.values.shape[1] == model.nq, "columns", found.values.shape[1], f"{model.nq}, the model's qpos")
        return Motion(model, found.time, found.values, activation, label)
    joints = _coordinates(model)
    muscles = {model.actuator(i).name: i for i in range(model.nu)}
    tied = _tied(model)
    named = set(found.names)
    rows = len(found.time)
    check(8 * rows * model.nq <= MAX_MODEL_BYTES, "rows", rows, f"fewer for {model.nq:,} coordinates of the model")
    wrong = [name for name in found.names if name not in joints and name not in muscles]
    missing = [name for name, place in joints.items() if name not in named and place not in tied]
    if not partial:
        problems = [_listed(kind, names) for kind, names in (("unknown", wrong), ("missing", missing)) if names]
        if problems:
            known = ", ".join(joints)
            raise ValueError(f"{'; '.join(problems)}; the joints of the model are {known[:400]}. See `partial`")
    check(len(wrong) < len(found.names), "columns", list(found.names)[:20], "the names of joints of the model")
    _check_finite(found, [*joints, *muscles])
    start = np.array(model.key_qpos[0] if model.nkey else model.qpos0)
    position = np.tile(start, (len(found.time), 1))
    turning = (int(mujoco.mjtJoint.mjJNT_HINGE),)
    for name, column in zip(found.names, found.values.T, strict=True):
        if name in joints:
            joint = int(np.searchsorted(model.jnt_qposadr, joints[name], side="right")) - 1
            angle = int(model.jnt_type[joint]) in turning
            position[:, joints[name]] = np.radians(column) if found.degrees and angle else column
        elif name in muscles:
            activation[:, muscles[name]] = column
    given = {joints[name] for name in found.names if name in joints}
    for place, (source, reference, polynomial) in tied.items():
        if place not in given:
            moved = position[:, source] - model.qpos0[source] if source is not None else np.zeros(len(position))
            position[:, place] = reference + np.polynomial.polynomial.polyval(moved, polynomial)
    return Motion(model, found.time, position, activation, label)


def _check_finite(found: Columns, used: Iterable[str]) -> None:
    """Refuse columns of these names that have other numbers than finite ones; what is left out may have."""
    used = set(used)
    for name, column in zip(found.names or (), found.values.T, strict=True):
        check(name not in used or np.all(np.isfinite(column)), f"numbers of {shown(name)}", "not finite", "finite")


def _coordinates(model: mujoco.MjModel) -> dict[str, int]:
    """The names of the numbers of `qpos`, and their places: of a joint with several its name and a number from 1."""
    found = {}
    for i in range(model.njnt):
        name = model.joint(i).name or f"joint {i + 1}"
        first = int(model.jnt_qposadr[i])
        size = (model.jnt_qposadr[i + 1] if i + 1 < model.njnt else model.nq) - first
        found |= {name: first} if size == 1 else {f"{name} {k + 1}": first + k for k in range(size)}
    return found


def _tied(model: mujoco.MjModel) -> dict[int, tuple[int | None, float, np.ndarray]]:
    """The entries of `qpos` that joint equalities determine, each with the entry it depends on, the reference and the
    polynomial."""
    import mujoco

    found = {}
    for i in np.flatnonzero((model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_active0 > 0)):
        place = int(model.jnt_qposadr[model.eq_obj1id[i]])
        other = int(model.eq_obj2id[i])
        source = int(model.jnt_qposadr[other]) if other >= 0 else None
        found[place] = source, float(model.qpos0[place]), np.array(model.eq_data[i, :5])
    return found


def _listed(kind: str, names: list[str]) -> str:
    more = f" and {len(names) - 12} more" if len(names) > 12 else ""
    return f"{kind} columns: {', '.join(map(shown, names[:12]))}{more}"


def _columns(path: Path, model: mujoco.MjModel) -> Columns:
    check(path.suffix.lower() in MOTION_SUFFIXES, "file", path.name, f"a file ending in {', '.join(MOTION_SUFFIXES)}")
    check(path.is_file(), "file", str(path), "an existing file")
    kind = path.suffix.lower()
    try:
        content = content_of(path, MAX_MOTION_BYTES)
        if kind == ".npy":
            values = np.atleast_2d(numbers_in(array_in(content), MAX_MOTION_BYTES))
            found = Columns(np.arange(len(values)) / RATE, None, values)
        elif kind == ".npz":
            found = _of_arrays(arrays_in(content, MAX_MOTION_BYTES))
        else:
            found = _of_text(content.decode("utf-8", errors="replace"), kind == ".csv")
    except (OSError, EOFError, IndexError) as error:
        raise ValueError(f"cannot be read: {' '.join(str(error).split()) or type(error).__name__}") from None
    del model
    check(len(found.time) > 0, "rows", 0, "at least one")
    tables = [found.values, *([] if found.activation is None else [found.activation])]
    for each in (found.time, *(tables if found.names is None else tables[1:])):
        check(np.all(np.isfinite(each)), "numbers", "not finite", "finite")
    for each in tables:
        check(each.ndim == 2, "shape", each.shape, "rows and columns")
        check(len(each) == len(found.time), "rows", len(each), f"{len(found.time)}, one for each moment")
    return found


def _of_arrays(stored: dict[str, np.ndarray]) -> Columns:
    arrays = {name: numbers_in(each, MAX_MOTION_BYTES) for name, each in stored.items()}
    lengthless = [name for name, each in arrays.items() if each.ndim == 0]
    check(not lengthless, "array", lengthless, "one of numbers, not a single one")
    time = next((arrays.pop(name) for name in TIME if name in arrays), None)
    activation = arrays.pop("activation", None)
    whole = next((arrays.pop(name) for name in ("qpos", "position") if name in arrays), None)
    if whole is None and not arrays and activation is not None:
        whole = np.zeros((len(activation), 0))
    if whole is not None:
        names = None
        values = whole
    else:
        names = tuple(arrays)
        check(names, "arrays", "none", "one for each joint, or qpos")
        lengths = {name: np.shape(each) for name, each in arrays.items()}
        alike = len(set(lengths.values())) == 1 and len(next(iter(lengths.values()))) == 1
        check(alike, "arrays", lengths, "alike long, one number for each moment")
        values = np.stack([*arrays.values()], axis=1)
    rows = len(values)
    time = np.arange(rows) / RATE if time is None else time.ravel()
    check(len(time) == rows, "time", f"{len(time)} moments", f"{rows}, as many as there are rows")
    return Columns(time, names, values, False, activation)


def _of_text(text: str, commas: bool) -> Columns:
    lines = [line.strip() for line in text.splitlines()]
    header = 0
    degrees = False
    ends = [place for place, line in enumerate(lines) if line.lower() == "endheader"]
    if ends:
        header = ends[0] + 1
        degrees = any(re.fullmatch(r"indegrees\s*=\s*yes", line.lower()) for line in lines[:header])
    lines = [line for line in lines[header:] if line]
    check(len(lines) > 1, "rows", max(len(lines) - 1, 0), "a line of names, and at least one of numbers")
    mark = "," if commas else "\t" if "\t" in lines[0] else None  # names may have spaces between tabs

    def split(line: str) -> list[str]:
        return [word.strip() for word in line.split(mark)]

    names = split(lines[0])
    numbers = len(lines) * len(names)
    check(8 * numbers <= MAX_MOTION_BYTES, "numbers", numbers, f"at most {MAX_MOTION_BYTES // 8:,}")
    values = np.empty((len(lines) - 1, len(names)))
    for row, line in enumerate(lines[1:]):
        words = split(line)
        check(len(words) == len(names), "columns", len(words), f"{len(names)} a row")
        values[row] = [_number(word) for word in words]
    for name, number in Counter(names).items():
        check(number == 1, "column", name, "given once")
    place = next((place for place, name in enumerate(names) if name.lower() in TIME), None)
    if place is None:
        raise ValueError(f"missing column: time, in s; the columns are {', '.join(map(shown, names[:12]))}")
    kept = [(k, _short(name)) for k, name in enumerate(names) if k != place]
    kept = [(k, name) for k, name in kept if name]
    return Columns(values[:, place], tuple(name for _, name in kept), values[:, [k for k, _ in kept]], degrees)


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise ValueError(f"{shown(word)}: must be a number") from None


def _short(name: str) -> str:
    """The name of a coordinate or a muscle; empty for other states of OpenSim, such as speeds."""
    if not name.startswith(_STATES):
        return name
    *_, place, what = name.split("/")
    return place if what in ("value", "activation") else ""
