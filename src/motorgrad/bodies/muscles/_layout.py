"""Where MuJoCo's structs keep what the laws of muscles read: from MuJoCo's own description of them, and then tried."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import ctypes
import functools
from typing import Any

import mujoco

_NUMBERS = {
    "int": ctypes.c_int,
    "float": ctypes.c_float,
    "mjtNum": ctypes.c_double,
    "mjtSize": ctypes.c_int64,
    "mjtBool": ctypes.c_bool,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
}
_POINTER = ctypes.sizeof(ctypes.c_void_p)


def place_of_array(struct: mujoco.MjModel | mujoco.MjData, attribute: str) -> int:
    """Where a struct keeps the pointer to one of its arrays, counted in pointers from the struct's start.

    **Arguments:** `struct`: a `mujoco.MjModel` or a `mujoco.MjData` in which the array is not empty.

    **Raises:** `RuntimeError` if that pointer is not there.
    """
    kind = type(struct).__name__
    place = _place(attribute, getattr(layout_of(kind.replace("Mj", "mj")), attribute).offset)
    pointer = ctypes.c_void_p.from_address(struct._address + place * _POINTER).value
    return _tried(place, f"{kind}.{attribute}", pointer, getattr(struct, attribute).ctypes.data)


def place_of_timestep(model: mujoco.MjModel) -> int:
    """Where a model keeps its time step, which is a number and no pointer, counted likewise.

    **Raises:** `RuntimeError` if it is not there.
    """
    within = layout_of("mjModel").opt.offset + layout_of("mjOption").timestep.offset
    place = _place("timestep", within)
    number = ctypes.c_double.from_address(model._address + place * _POINTER).value
    return _tried(place, "MjModel.opt.timestep", number, model.opt.timestep)


@functools.cache
def layout_of(name: str) -> Any:
    """A struct of MuJoCo's, such as `mjModel`, as ctypes has it: its fields have an `offset` in bytes."""
    from mujoco.introspect import structs  # a long table, which few programs need

    return _structure(structs.STRUCTS[name])


def _structure(described: Any) -> Any:
    fields = [(each.name, _type(each.type)) for each in described.fields]
    return type("Struct", (ctypes.Structure,), {"_fields_": fields})


def _type(described: Any) -> Any:
    from mujoco.introspect import ast_nodes

    if isinstance(described, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(described, ast_nodes.AnonymousStructDecl):
        return _structure(described)
    if isinstance(described, ast_nodes.ArrayType):
        found = _type(described.inner_type)
        for extent in reversed(described.extents):
            found = found * extent
        return found
    return _NUMBERS[described.name] if described.name in _NUMBERS else layout_of(described.name)


def _place(attribute: str, offset: int) -> int:
    if offset % _POINTER:
        raise RuntimeError(_other(attribute, f"{offset} bytes from the start"))
    return offset // _POINTER


def _tried(place: int, what: str, found: object, wanted: object) -> int:
    if found != wanted:
        raise RuntimeError(_other(what, "not where MuJoCo's description of its structs says"))
    return place


def _other(what: str, problem: str) -> str:
    return (
        f"MuJoCo {mujoco.__version__}: {what} is {problem}, so the muscle law cannot be installed; "
        "use mujoco>=4.0,<4.1, or muscle_model='native'"
    )
