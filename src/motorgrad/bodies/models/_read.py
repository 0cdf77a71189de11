"""Reading MuJoCo models: every model is read, bounded and compiled here."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import hashlib
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import mujoco

from motorgrad._errors import check, check_finite, shown_path
from motorgrad.bodies.models._bounds import asset_files, check_size
from motorgrad.bodies.models._meaning import check_meaning, check_user_types
from motorgrad.bodies.models._scan import Documents, read_bytes, scan
from motorgrad.bodies.muscles._callback import check_muscle_callback, install_muscle_callback

T = TypeVar("T")
_MUSCLE, _BIAS = mujoco.mjtGain.mjGAIN_MUSCLE, mujoco.mjtBias.mjBIAS_MUSCLE
_BROKEN = {
    "positions": mujoco.mjtWarning.mjWARN_BADQPOS,
    "velocities": mujoco.mjtWarning.mjWARN_BADQVEL,
    "accelerations": mujoco.mjtWarning.mjWARN_BADQACC,
}


def read_model(source: Path | str, edit: Callable[[mujoco.MjSpec], object] | None = None) -> mujoco.MjModel:
    """Compile a model from any source. A broken or oversized model raises one clear error.

    **Arguments:**

    - `source`: the `Path` of an MJCF or URDF file, with its meshes and textures beside it; or the document itself, as
      text.
    - `edit`: changes the description before it is compiled.

    **Returns:** the model, as `compile_model` does.

    **Raises:** `ValueError`, in one line, for what MuJoCo refuses and for a model beyond the limits of size, which the
    page on bodies lists.

    ```python
    model = mg.bodies.read_model("<mujoco><worldbody><geom size='0.1'/></worldbody></mujoco>")
    ```
    """

    def read() -> mujoco.MjModel:
        spec, documents = read_spec(source)
        if edit is not None:
            edit(spec)
        return compile_spec(spec, documents.folders)

    return in_source(source, read)


def in_source(source: Path | str, do: Callable[[], T]) -> T:
    """Call a function; its errors name the model, in one line."""
    where = f"file = {shown_path(source)}" if isinstance(source, Path) else "xml"
    try:
        return do()
    except ValueError as error:
        message = " ".join(str(error).split())
        raise ValueError(message if message.startswith(where) else f"{where}: {message}") from None


def read_spec(source: Path | str, assets: Mapping[str, bytes] | None = None) -> tuple[mujoco.MjSpec, Documents]:
    """Read a description within the limits, without compiling it.

    **Arguments:** `source`: as `read_model`; `assets`: the content of files that a document given as text names.

    **Returns:** the description, and where its documents are.
    """
    if isinstance(source, Path):
        check(source.is_file(), "file", str(source), "an existing MJCF file")
        documents = scan(read_bytes(source), source.parent)
        return _guarded("read", lambda: mujoco.MjSpec.from_file(str(source))), documents
    documents = scan(source.encode(), Path())
    given = None if assets is None else dict(assets)
    return _guarded("read", lambda: mujoco.MjSpec.from_string(source, assets=given)), documents


def check_file(source: Path) -> None:
    """Refuse a model's file that would exhaust memory, or never be compiled, where somebody else is to compile it.

    **Raises** `ValueError`, in one line, as `read_model`, for a model beyond the limits of size.
    """

    def check_it() -> None:
        spec, documents = read_spec(source)
        check_size(spec, documents.folders)
        _check_ranges(spec)

    in_source(source, check_it)


def checksum_of(source: Path, spec: mujoco.MjSpec, documents: Documents) -> str:
    """A checksum of a model's file and of all files that it includes or names, wherever their folder is."""
    more = {*documents.files, *(path for paths in asset_files(spec, documents.folders).values() for path in paths)}
    named = {os.path.relpath(path, source.parent): path for path in more if path.is_file()}
    found = hashlib.sha256(source.read_bytes())
    for name, path in sorted(named.items()):
        found.update(name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()[:32]


def compile_spec(spec: mujoco.MjSpec, folders: Iterable[Path] = ()) -> mujoco.MjModel:
    """Compile a description within the limits, with the muscle law in place.

    **Arguments:** `spec`: the description; `folders`: where its files may be, beside its own folder.

    **Raises:** `ValueError` for a description that MuJoCo refuses or that is too large; `RuntimeError` if another gain
    callback is installed.
    """
    # before compiling, which briefly runs the physics and would call a foreign callback
    install_muscle_callback(spec)
    model = compile_bare(spec, folders)
    check_muscle_callback(model)
    check_user_types(model)
    return model


def compile_bare(spec: mujoco.MjSpec, folders: Iterable[Path] = ()) -> mujoco.MjModel:
    """Compile a description within the limits, of which every number has a meaning, whatever its muscles do."""
    check_size(spec, folders)
    _check_ranges(spec)
    model = _guarded("compile", spec.compile)
    check_meaning(model)
    return model


def _check_ranges(spec: mujoco.MjSpec) -> None:
    """Refuse numbers with which the length ranges of muscles would be sought for ever.

    MuJoCo finds them by simulation. It resets one that breaks at once, such as of a body at infinity, and never ends.
    """
    search = spec.compiler.LRopt
    for name in ("accel", "maxforce", "timeconst", "timestep", "inttotal", "interval", "tolrange"):
        check_finite(f"lengthrange: {name}", getattr(search, name))
    wanted = [each for each in spec.actuators if each.gaintype == _MUSCLE or each.biastype == _BIAS]
    if search.mode == mujoco.mjtLRMode.mjLRMODE_NONE or not (wanted or search.mode != mujoco.mjtLRMode.mjLRMODE_MUSCLE):
        return
    trial = spec.copy()
    trial.compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE
    for each in trial.actuators:
        each.lengthrange = (0.0, 1.0)
    trial.option.timestep = 1e-9  # what a wild but finite model survives
    model = _guarded("compile", trial.compile)
    data: Any = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    mujoco.mj_step(model, data)
    broken = [name for name, kind in _BROKEN.items() if data.warning.number[kind]]
    allowed = "finite, so that the length ranges of muscles can be found"
    check(not broken, "numbers of the model", f"{', '.join(broken)} infinite or huge", allowed)


def _guarded(what: str, do: Callable[[], T]) -> T:
    """MuJoCo's exceptions as ours. They have many types: out of memory alone comes as four of them."""
    try:
        return do()
    except Exception as error:
        message = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"MuJoCo cannot {what} it: {message}") from None
