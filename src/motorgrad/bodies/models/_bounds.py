"""The memory that a MuJoCo model will need, estimated before it is compiled."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import math
import struct
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path, PureWindowsPath
from typing import Any, TypeAlias

import mujoco

from motorgrad._errors import check
from motorgrad._limits import (
    MAX_MODEL_ARENA_BYTES,
    MAX_MODEL_BODY_DEPTH,
    MAX_MODEL_BYTES,
    MAX_MODEL_OCTREE_LEVELS,
    MAX_MODEL_RANGE_STEPS,
    MAX_MODEL_RESERVED_BYTES,
)
from motorgrad._reading import content_of
from motorgrad.bodies.models._scan import check_bytes, file_size, files_of, product

_Asset: TypeAlias = mujoco.MjsTexture | mujoco.MjsHField | mujoco.MjsMesh | mujoco.MjsSkin
_NUMBER = 8  # bytes
_KEY = 1_000  # bytes of a keyframe without its numbers
_MESH = 8  # bytes of a compiled mesh or skin per byte of its file
_PIXEL = 8  # bytes while an image is read, at 16 bits per channel
_INERTIA = 64  # bytes for each pair of degrees of freedom along one branch, in all sparse matrices
_CONTACT = 600  # bytes
_PAIR_CONTACTS = 8  # of two geoms, at most, but for those of the next line
_MANY_CONTACTS = (mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF)
_ROWS = {1: 1, 3: 4, 4: 6, 6: 10}  # of the constraints of a contact, by its dimensions
_EQUALITY_ROWS = 7
_SPARSE = 60  # degrees of freedom from which MuJoCo's Jacobians are sparse
_ROW = 600  # bytes for a row of the constraints, without its entries
_ENTRY = 60  # bytes for each entry of a row, with all copies in the solver
_DUAL = 24  # bytes for each pair of rows, in solvers that need the inverse inertia of constraints
_ZIPPED = 1032  # bytes that a byte of a compressed chunk can become, at most
_MOMENT = 16  # bytes of a sparse matrix per entry
_DATA_OF_CONTACT = 17  # numbers for each contact of a contact sensor
_DATA_OF_PIXEL = 13  # numbers for each pixel of a range finder
_DOFS = {mujoco.mjtJoint.mjJNT_FREE: 6, mujoco.mjtJoint.mjJNT_BALL: 3}
_USERS = {
    "body": "bodies",
    "jnt": "joints",
    "geom": "geoms",
    "site": "sites",
    "cam": "cameras",
    "tendon": "tendons",
    "actuator": "actuators",
    "sensor": "sensors",
}


def check_size(spec: mujoco.MjSpec, folders: Iterable[Path] = ()) -> None:
    """Refuse a description whose model would need more than `MAX_MODEL_BYTES`, or would never finish compiling.

    **Arguments:** `spec`: the description; `folders`: where its files may be, beside its own folder.

    **Raises:** `ValueError` that names what is too large, the number given, and the limit.
    """
    dofs, pairs, deepest = _branches(spec)
    possible = _possible(spec, dofs, deepest)
    for what, value, size in _arena(spec, dofs):
        check_bytes(what, value, size, MAX_MODEL_RESERVED_BYTES)
        check_bytes(what, value, min(size, possible), MAX_MODEL_ARENA_BYTES)
    total = 0.0
    for what, value, size in _sizes(spec, dofs, pairs, [Path(spec.modelfiledir), *folders]):
        total += max(0.0, size)
        check_bytes(what, value, total)
    search = spec.compiler.LRopt
    steps = search.inttotal / max(search.timestep, 1e-12)
    limit = f"at most {MAX_MODEL_RANGE_STEPS:,} steps"
    check(steps <= MAX_MODEL_RANGE_STEPS, "lengthrange: inttotal / timestep", steps, limit)


def _sizes(spec: mujoco.MjSpec, dofs: int, pairs: int, folders: list[Path]) -> Iterator[tuple[str, Any, float]]:
    """Everything whose size is a number of the description, as (name, number given, bytes)."""
    acts = sum(max(1, each.actdim) for each in spec.actuators)
    yield "pairs of degrees of freedom along a branch", pairs, _INERTIA * pairs
    yield "nuserdata", spec.nuserdata, _NUMBER * spec.nuserdata
    for kind, many in _USERS.items():
        each = getattr(spec, f"nuser_{kind}")
        yield f"nuser_{kind}", each, _NUMBER * each * len(getattr(spec, many))
    keys = max(spec.nkey, len(spec.keys))
    mocap = sum(bool(each.mocap) for each in spec.bodies)
    # a position has at most 7 numbers for 6 of a velocity
    yield "nkey", keys, keys * (_KEY + _NUMBER * (3 * dofs + 2 * acts + 7 * mocap))
    moments = (len(spec.tendons) + len(spec.actuators)) * dofs
    yield "(tendons + actuators) × degrees of freedom", moments, _MOMENT * moments
    for each in spec.numerics:
        yield f"size of numeric {each.name!r}", each.size, _NUMBER * each.size
    for each in spec.actuators:
        yield f"actdim of actuator {each.name!r}", each.actdim, _NUMBER * each.actdim
        yield f"nsample of actuator {each.name!r}", each.nsample, 2 * _NUMBER * each.nsample
    for each in spec.sensors:
        what, value, numbers = _readings(spec, each)
        yield f"{what} of sensor {each.name!r}", value, _NUMBER * numbers
        yield f"nsample of sensor {each.name!r}", each.nsample, _NUMBER * each.nsample * (1 + numbers)
    for each in spec.plugins:
        size = each.config.get("size", "1")
        yield f"size of plugin {each.name!r}", size, _NUMBER * product(size)
    yield from _assets(spec, folders)


def _branches(spec: mujoco.MjSpec) -> tuple[int, int, int]:
    """The degrees of freedom; the pairs of them of which one moves the other, entries of the mass matrix; and the most
    that move one body.
    """
    dofs = pairs = deepest = 0
    todo = [(spec.worldbody, 0, 0)]
    while todo:
        body, above, depth = todo.pop()
        check(depth <= MAX_MODEL_BODY_DEPTH, "bodies within bodies", depth, f"at most {MAX_MODEL_BODY_DEPTH}")
        for inner in body.bodies:
            own = sum(_DOFS.get(joint.type, 1) for joint in inner.joints)
            dofs = dofs + own
            pairs = pairs + own * above + own * (own + 1) // 2
            deepest = max(deepest, above + own)
            todo.append((inner, above + own, depth + 1))
    return dofs, pairs, deepest


def _possible(spec: mujoco.MjSpec, dofs: int, deepest: int) -> float:
    """The bytes that contacts and constraints use if everything touches everything at once, whatever is reserved."""
    if spec.flexes:
        return math.inf
    solid = [each for each in spec.geoms if each.contype or each.conaffinity]
    fields = sum(each.type in _MANY_CONTACTS for each in solid)
    pairs = len(solid) * (len(solid) - 1) / 2 + len(spec.pairs)
    contacts = _PAIR_CONTACTS * pairs + int(mujoco.mjMAXCONPAIR) * fields * len(solid)
    condim = max((each.condim for each in (*solid, *spec.pairs)), default=1)
    rows = contacts * _ROWS.get(condim, max(_ROWS.values())) + 2 * (dofs + len(spec.tendons))
    rows += _EQUALITY_ROWS * len(spec.equalities)
    option = spec.option
    sparse = option.jacobian == mujoco.mjtJacobian.mjJAC_SPARSE
    sparse = sparse or (option.jacobian == mujoco.mjtJacobian.mjJAC_AUTO and dofs >= _SPARSE)
    # a contact moves two branches; an equality or a tendon may join all
    joined = bool(spec.equalities or spec.tendons)
    width = min(dofs, 2 * deepest) if sparse and not joined else dofs
    used = _CONTACT * contacts + rows * (_ROW + _ENTRY * width) + _ENTRY * float(dofs) ** 2
    dual = option.solver == mujoco.mjtSolver.mjSOL_PGS or option.noslip_iterations > 0
    return used + (_DUAL * rows**2 if dual else 0.0)


def _arena(spec: mujoco.MjSpec, dofs: int) -> Iterator[tuple[str, Any, float]]:
    """The memory that MuJoCo reserves for contacts and constraints, by its own rule."""
    if spec.memory != -1:
        yield "memory", spec.memory, spec.memory
        return
    rows = 500 if spec.njmax == -1 else spec.njmax
    contacts = 100 if spec.nconmax == -1 else spec.nconmax
    yield "nconmax", contacts, _CONTACT * contacts
    yield "njmax", rows, rows * (150 + 24 * dofs + 12 * rows)
    if spec.nstack != -1:
        yield "nstack", spec.nstack, _NUMBER * spec.nstack
        return
    rows += len(spec.equalities) + dofs
    hint = "njmax + equalities + degrees of freedom, without <size memory=...>,"
    yield hint, rows, 5 * _NUMBER * rows * rows


def _readings(spec: mujoco.MjSpec, sensor: mujoco.MjsSensor) -> tuple[str, Any, float]:
    """What decides how many numbers a sensor gives; its value; and how many at most."""
    kind = mujoco.mjtSensor
    if sensor.type == kind.mjSENS_CONTACT:
        return "num", int(sensor.intprm[2]), _DATA_OF_CONTACT * int(sensor.intprm[2])
    if sensor.type == kind.mjSENS_PLUGIN:
        config = sensor.plugin.config
        size = config.get("size", "1")
        return "size", size, product(f"{size} {config.get('nchannel', '1')}")
    if sensor.type == kind.mjSENS_RANGEFINDER and sensor.objtype == mujoco.mjtObj.mjOBJ_CAMERA:
        camera = spec.camera(sensor.objname)
        size = [1, 1] if camera is None else camera.resolution
        return "resolution of the camera", f"{size[0]} × {size[1]}", _DATA_OF_PIXEL * float(size[0]) * float(size[1])
    return "dim", sensor.dim, float(sensor.dim)


def asset_files(spec: mujoco.MjSpec, folders: Iterable[Path]) -> dict[str, list[Path]]:
    """The files that the assets of a description may mean, by the name that it gives them."""
    folders = [Path(spec.modelfiledir), *folders]
    found = {}
    for each in (*spec.textures, *spec.hfields, *spec.meshes, *spec.skins):
        for name in filter(None, [each.file, *getattr(each, "cubefiles", ())]):
            found[name] = _paths(each, name, folders)
    return found


def _paths(asset: _Asset, file: str, folders: list[Path]) -> list[Path]:
    """The files that an asset may mean. Its folder depends on the compiler's settings."""
    inner = {"", asset.compiler.meshdir, asset.compiler.texturedir}
    return sorted({*files_of(file, folders, inner), *files_of(PureWindowsPath(file).name, folders, inner)})


def _assets(spec: mujoco.MjSpec, folders: list[Path]) -> Iterator[tuple[str, Any, float]]:
    for each in spec.textures:
        name = f"texture {each.name!r}"
        builtin = each.builtin != mujoco.mjtBuiltin.mjBUILTIN_NONE
        cube = builtin and each.type != mujoco.mjtTexture.mjTEXTURE_2D
        height = 6 * each.width if cube else each.height
        yield f"{name}: width × height", f"{each.width} × {height}", float(each.nchannel) * each.width * height
        for file in filter(None, [each.file, *each.cubefiles]):
            yield from _file(spec, each, name, file, folders, image=True)
    for each in spec.hfields:
        name = f"height field {each.name!r}"
        yield f"{name}: nrow × ncol", f"{each.nrow} × {each.ncol}", 4.0 * each.nrow * each.ncol
        yield from _file(spec, each, name, each.file, folders, image=True)
    for kind, assets in (("mesh", spec.meshes), ("skin", spec.skins)):
        for each in assets:
            yield from _file(spec, each, f"{kind} {each.name!r}", each.file, folders, image=False)
    for each in spec.meshes:
        deep = each.octree_maxdepth
        limit = f"at most {MAX_MODEL_OCTREE_LEVELS}"
        check(deep <= MAX_MODEL_OCTREE_LEVELS, f"octree_maxdepth of mesh {each.name!r}", deep, limit)


def _file(
    spec: mujoco.MjSpec, asset: _Asset, name: str, file: str, folders: list[Path], image: bool
) -> Iterator[tuple[str, Any, float]]:
    """Each file that an asset may mean."""
    if not file:
        return
    for given in {file, PureWindowsPath(file).name} & set(spec.assets):
        yield from _content(name, file, spec.assets[given], image)
    for path in _paths(asset, file, folders):
        size = file_size(path)
        check_bytes(f"{name}: bytes of {file}", size, size)
        yield from _content(name, file, content_of(path, MAX_MODEL_BYTES), image)


def _content(name: str, file: str, content: bytes, image: bool) -> Iterator[tuple[str, Any, float]]:
    if not image:
        yield f"{name}: bytes of {file}", len(content), _MESH * len(content)
    elif content[:8] == b"\x89PNG\r\n\x1a\n" and len(content) >= 29:
        width, height, depth, colour = struct.unpack(">IIBB", content[16:26])
        yield f"{name}: width × height of {file}", f"{width} × {height}", float(_PIXEL) * width * height
        # twice the bytes of its pixels: lines of an interlaced image have more bytes besides
        most = 2 * height * (8 + width * depth * {0: 1, 3: 1, 4: 2, 6: 4}.get(colour, 3) / 8)
        yield f"{name}: texts within {file}", "compressed", _unpacked(f"{name}: bytes within {file}", content, most)
    elif len(content) >= 8:
        # MuJoCo's own format of height fields: it compares the length with a product of 32 bits
        rows, columns = struct.unpack("<2i", content[:8])
        if (rows * columns - (len(content) - 8) / 4) % 2**32 == 0:
            yield f"{name}: nrow × ncol of {file}", f"{rows} × {columns}", 4.0 * rows * columns


def _unpacked(name: str, content: bytes, most: float) -> float:
    """The bytes that the texts of a PNG become, at most. Its pixels must not become more than `most` bytes."""
    place = 8
    image = zlib.decompressobj()
    pixels = 0
    texts = 0
    while place + 8 <= len(content):
        length, kind = struct.unpack(">I4s", content[place : place + 8])
        part = content[place + 8 : place + 8 + length]
        place += 12 + length
        if kind in (b"zTXt", b"iTXt", b"iCCP"):
            texts += _ZIPPED * len(part)
        while kind == b"IDAT" and part:
            try:
                pixels += len(image.decompress(part, 2**20))
            except zlib.error:  # which MuJoCo reports
                break
            check(pixels <= most, name, f"{pixels} or more", f"at most {most:.0f} for its width and height")
            part = image.unconsumed_tail
    return texts
