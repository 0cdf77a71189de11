"""Writing a body as MJCF without losing digits."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import contextlib
import ctypes
import pathlib
import re
from collections.abc import Iterator

import mujoco
import numpy as np

from motorgrad.bodies._body import Body

_DOUBLE_DIGITS = 17
# more digits than MuJoCo writes by itself: the trace of a number that has no short decimal form
_LONG_NUMBER = re.compile(r"-?\d+\.\d{8,}(?:e[-+]?\d+)?|-?\d+(?:\.\d+)?e[-+]?\d+")
_COLOUR = re.compile(r'(?<=rgba=")[^"]*')


def to_mjcf(body: Body | mujoco.MjSpec) -> str:
    """The body as MJCF, MuJoCo's XML format, for other programs.

    **Arguments:** `body`: a body, or a description such as `body.spec()`.

    **Returns:** the document, with every digit, so that the model made of it moves as this one does. Muscles of the
    "thesis" model need the gain callback wherever it is loaded (`install_muscle_callback`); export
    `muscle_model="native"` for programs that have none.
    """
    spec = body if isinstance(body, mujoco.MjSpec) else body.spec()
    spec.compile()  # the writer needs resolved references
    with _all_digits():
        xml = spec.to_xml()
    # colours are stored in single precision; 0.9 needs no seventeen digits there
    xml = _COLOUR.sub(lambda found: " ".join(str(np.float32(x)) for x in found.group().split()), xml)
    return _LONG_NUMBER.sub(lambda found: repr(float(found.group())), xml)


@contextlib.contextmanager
def _all_digits() -> Iterator[None]:
    """Make MuJoCo write seventeen digits for a while; six, its default, move the hopper elsewhere within a second.

    The setting has no public name. Where a library lacks it, six digits it is.
    """
    try:
        paths = sorted(pathlib.Path(mujoco.__file__).parent.glob("*mujoco*.*"))
        library = ctypes.CDLL(str(next(p for p in paths if p.suffix in (".dll", ".dylib") or ".so." in p.name)))
        get, put = library._mjPRIVATE__get_xml_precision, library._mjPRIVATE__set_xml_precision
    except (StopIteration, OSError, AttributeError):
        yield
        return
    before = get()
    put(_DOUBLE_DIGITS)
    try:
        yield
    finally:
        put(before)
