"""Reads a policy that motorgrad exported as .npz. It needs NumPy alone: copy it where motorgrad is not installed.

A file is data, whoever made it. It may call the functions of `ELEMENTWISE` and of `_shape`, and no others; names,
arguments, types and sizes are checked before anything is computed.
"""

import collections
import io
import json
import math
import os
import re
import stat
import tokenize
import zipfile
import zlib

import numpy as np

BYTES = 2**30  # of a file, and of its arrays, unpacked
ENTRIES = 10_000  # of a file
ENTRY = b"PK\1\2"  # how each begins in the table of contents
PLAIN = (0, 8)  # stored and deflated; the others are unpacked as a whole, however much it becomes
TEXT = 2**24  # characters of the list of functions
MAX_FUNCTION_NUMBERS = 2**27  # that one function makes, products of matrices included
AXES = 32
TYPES = ["bool", "float16", "float32", "float64"]
TYPES += [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
OF_ONE = (
    "abs arccos arcsin arctan asarray bitwise_not ceil cos cosh exp expm1 floor isfinite log log1p negative rint sign "
    "sin sinh sqrt tan tanh"
)
OF_TWO = (
    "add arctan2 bitwise_and bitwise_or bitwise_xor divide equal fmod greater greater_equal left_shift less "
    "less_equal maximum minimum multiply not_equal power right_shift subtract"
)
ELEMENTWISE = {**dict.fromkeys(OF_ONE.split(), 1), **dict.fromkeys(OF_TWO.split(), 2), "where": 3}
"""The number of arguments of each function of elements."""
DAMAGED = (ValueError, KeyError, EOFError, RuntimeError, OverflowError, zipfile.BadZipFile, zlib.error)
DAMAGED += (MemoryError, SyntaxError, tokenize.TokenError)  # of NumPy, which reads the head of an array as Python
DAMAGED += (SystemError,)  # of Python, for numbers of a text that are no characters


class Exported(dict):
    """The functions of an exported policy by name. `interface` is the table of `motorgrad.policies.Interface`, with
    names, shapes, scales and codes; `None` where the policy belonged to no task."""

    interface: dict | None = None


def read(path):
    """The functions of an exported policy by name. Each takes arrays by name, and returns arrays by name. **Raises**
    `ValueError` for a damaged file, and for one that asks for anything but arithmetic on its arrays."""
    try:
        content = _content(path)
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            size = sum(member.file_size for member in file.infolist())
            if size > BYTES:
                raise ValueError(f"{size:,} bytes unpacked: at most {BYTES:,} are read")
            arrays = {member.filename.removesuffix(".npy"): _array(file, member) for member in file.infolist()}
        functions = _text(arrays.pop("functions"))
        interface = arrays.pop("interface", None)
        for name, array in arrays.items():
            _check_name(name)
            _check_type(f"array {name!r}", array.dtype.name)
        shapes = {place: array.shape for place, array in arrays.items()}
        found = Exported()
        for name, parts in _is(functions, dict).items():
            found[name] = _function(name, arrays, shapes, *parts)
        if interface is not None:
            found.interface = _is(_text(interface), dict)
        return found
    except DAMAGED as error:
        message = " ".join(str(error).split())[:300]
        raise ValueError(f"{path}: not an exported policy: {message or type(error).__name__}") from None
    except TypeError:
        raise ValueError(f"{path}: not an exported policy: a function is no inputs, steps and outputs") from None


def _text(array):
    """What a JSON text in an array says."""
    if array.nbytes > 4 * TEXT:
        raise ValueError(f"a text of {array.nbytes // 4:,} characters: at most {TEXT:,} are read")
    return json.loads(str(array))


def _content(path):
    """The bytes of a file. It must be a regular one: a device may never end, and a pipe never begin."""
    about = os.stat(path)
    if not stat.S_ISREG(about.st_mode) or about.st_size > BYTES:
        raise ValueError(f"must be a file of at most {BYTES:,} bytes")
    with open(path, "rb") as file:
        content = file.read(about.st_size)
    if content.count(ENTRY) > ENTRIES:  # before they are listed
        raise ValueError(f"must be of at most {ENTRIES:,} arrays")
    return content


def _array(file, member):
    """An array of the file. Its header allocates nothing, as it must fit the bytes that are there."""
    if member.compress_type not in PLAIN:
        raise ValueError(f"{member.filename}: must be stored or deflated")
    with file.open(member) as packed:
        content = packed.read(member.file_size)
    head = io.BytesIO(content)
    if np.lib.format.read_magic(head) != (1, 0):
        raise ValueError(f"{member.filename}: an unknown version of NumPy's format")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(head)
    return np.frombuffer(content, dtype, offset=head.tell()).reshape(shape, order="F" if fortran else "C")


def _function(name, arrays, known, inputs, steps, outputs):
    """A function of the file, once all of it is checked. `known` are the shapes of the arrays."""
    shapes = collections.ChainMap({}, known)
    size = 0

    def add(place, shape):
        if _check_name(place) in shapes:
            raise ValueError(f"function {name!r}: {place!r} is made twice")
        shapes[place] = shape

    for each, (place, shape, dtype) in _is(inputs, dict).items():
        _check_type(f"function {name!r}, input {each!r}", dtype)
        add(place, _whole(shape))
        size += math.prod(shape)
    for number, (place, function, arguments, dtype) in enumerate(_is(steps, list)):
        where = f"function {name!r}, step {number}"
        _check_type(where, dtype)
        try:
            shape, made = _shape(function, arguments, shapes)
        except (ValueError, TypeError) as error:
            raise ValueError(f"{where}: {_call(function, arguments)} is refused: {error}") from None
        add(place, shape)
        size += max(made, math.prod(shape))  # a sum over nothing still makes numbers
        if size > MAX_FUNCTION_NUMBERS:
            raise ValueError(
                f"{where}: {_call(function, arguments)} is refused: more than {MAX_FUNCTION_NUMBERS:,} numbers"
            )
    for each, place in _is(outputs, dict).items():
        if _is(place, str) not in shapes:
            raise ValueError(f"function {name!r}, output {each!r}: there is no array {place!r}")

    def call(**given):
        values = dict(arrays)
        if missing := [name for name in inputs if name not in given]:
            raise TypeError(f"missing inputs {missing}: all of {list(inputs)} are needed")
        for name, (place, shape, dtype) in inputs.items():
            values[place] = np.asarray(given.pop(name), dtype).reshape(shape)
        if given:
            raise TypeError(f"unknown inputs {list(given)}: known are {list(inputs)}")

        def value(x):
            return tuple(map(value, x)) if isinstance(x, list) else values.get(x, x) if isinstance(x, str) else x

        with np.errstate(all="ignore"):
            for place, function, arguments, dtype in steps:
                values[place] = np.asarray(getattr(np, function)(*value(arguments)), dtype)
        return {name: np.array(values[place]) for name, place in outputs.items()}

    return call


def _shape(function, arguments, shapes):
    """The shape of what a call makes, and how many numbers it computes. **Raises** `ValueError` unless the call is one
    of these, with arguments that fit."""

    def of(x):
        if isinstance(x, str) and x in shapes:
            return shapes[x]
        if isinstance(x, float) or (isinstance(x, int) and -(2**63) <= x < 2**64):
            return ()
        raise ValueError(f"{str(x)[:40]} is neither an array nor a number")

    match function, arguments:
        case str(name), [*operands] if len(operands) == ELEMENTWISE.get(name):
            made = np.broadcast_shapes(*map(of, operands))
            return made, math.prod(made)
        case ("reshape", [x, shape]) if math.prod(_whole(shape)) == math.prod(of(x)):
            return tuple(shape), math.prod(shape)
        case ("broadcast_to", [x, shape]) if np.broadcast_shapes(of(x), _whole(shape)) == tuple(shape):
            return tuple(shape), math.prod(shape)
        case "take", [x, index]:
            of(x)
            return of(index), math.prod(of(index))
        case "concatenate", [[_, *_] as parts, axis]:
            given = [list(of(x)) for x in parts]
            length = sum(shape.pop(_axis(axis, shape)) for shape in given)
            if given.count(given[0]) == len(given):
                made = (*given[0][:axis], length, *given[0][axis:])
                return made, math.prod(made)
        case "einsum", [str(spec), x, y] if match := re.fullmatch("([a-z]*),([a-z]*)->([a-z]*)", spec):
            first, second, made = match.groups()
            pairs = [*zip(first, of(x), strict=True), *zip(second, of(y), strict=True)]
            sizes = dict(pairs)
            if all(sizes[letter] == size for letter, size in pairs) and len(set(made)) == len(made):
                return tuple(sizes[letter] for letter in made), math.prod(sizes.values())
        case "argmax" | "argmin", [x, axis]:
            shape = list(of(x))
            shape.pop(_axis(axis, shape))
            return tuple(shape), math.prod(of(x))
        case "cumsum" | "cumprod", [x, axis]:
            _axis(axis, of(x))
            return of(x), math.prod(of(x))
        case "sum" | "prod" | "max" | "min" | "any" | "all", [x, [*axes]]:
            gone = {_axis(axis, of(x)) for axis in axes}
            if len(gone) == len(axes):
                made = tuple(length for axis, length in enumerate(of(x)) if axis not in gone)
                return made, math.prod(of(x))
    raise ValueError("an exported policy makes no such call")


def _axis(axis, shape):
    if type(axis) is not int or not 0 <= axis < len(shape):
        raise ValueError(f"axis {axis!r} of {len(shape)}")
    return axis


def _whole(shape):
    """A shape, as a tuple of whole numbers that are not too large."""
    right = isinstance(shape, list) and len(shape) <= AXES
    right = right and all(type(n) is int and 0 <= n <= MAX_FUNCTION_NUMBERS for n in shape)
    if not right or math.prod(shape) > MAX_FUNCTION_NUMBERS:
        raise ValueError(
            f"shape {str(shape)[:40]}: must be at most {AXES} whole numbers, {MAX_FUNCTION_NUMBERS:,} elements together"
        )
    return tuple(shape)


def _check_name(place):
    """A name of an array, which cannot be taken for the rule of a product."""
    if not _is(place, str).isidentifier():
        raise ValueError(f"{place[:40]!r} is no name of an array")
    return place


def _check_type(where, dtype):
    if dtype not in TYPES:
        raise ValueError(f"{where}: type {str(dtype)[:40]!r}: known are {', '.join(TYPES)}")


def _is(value, kind):
    if not isinstance(value, kind):
        raise ValueError(f"{str(value)[:40]!r} is no {kind.__name__}")
    return value


def _call(function, arguments):
    """A call in one line."""
    return f"{str(function)[:40]}({str(arguments)[:60]})"
