"""Reading MJCF that may come from anywhere: what is broken, or would fill the memory, is one clear error."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco

from motorgrad._errors import check
from motorgrad.bodies import compile_model

LONGEST = 1_000_000  # characters of a text
MOST_COPIES = 10_000
MOST_MEMORY = 2**31  # bytes


def read_model(xml: str, file: str = "") -> mujoco.MjModel:
    """The model in a text of MJCF; or in a file, whose meshes lie beside it.

    **Raises** `ValueError`, in one line, for what MuJoCo cannot read, and for a model that asks for more than 10,000
    copies of a part or 2 GiB.
    """
    where = f"file = {file!r}" if file else "xml"
    if file:
        check(Path(file).is_file(), "file", file, "an MJCF file that is there")
    check(len(xml) <= LONGEST, "xml", f"{len(xml)} characters", f"at most {LONGEST} characters")
    try:
        _check_copies(where, Path(file).read_bytes() if file else xml)
        spec = mujoco.MjSpec.from_file(file) if file else mujoco.MjSpec.from_string(xml)
        check(spec.memory <= MOST_MEMORY, f"{where}: memory", spec.memory, f"at most {MOST_MEMORY} bytes")
        return compile_model(spec)
    except (ValueError, UnicodeError, OSError, mujoco.FatalError) as error:
        told = " ".join(str(error).split())
        if told.startswith(where):
            raise ValueError(told) from None
        raise ValueError(f"{where}: MuJoCo cannot read it: {told}") from None


def _check_copies(where: str, text: str | bytes) -> None:
    """Refuse parts that would be copied too often, before MuJoCo copies them; other faults are for it to tell."""
    try:
        todo = [(ElementTree.fromstring(text), 1.0)]
    except (ElementTree.ParseError, ValueError, LookupError):
        return
    while todo:
        node, copies = todo.pop()
        try:
            copies *= math.prod(max(1.0, float(word)) for word in node.get("count", "1").split())
        except ValueError:
            continue
        check(copies <= MOST_COPIES, f"{where}: copies of a part", copies, f"at most {MOST_COPIES}")
        todo += [(inner, copies) for inner in node]
