"""How far a value is from where it is given to the field that checks it, counted while it travels."""

import contextlib
import importlib.util
import inspect
import sys
from pathlib import Path

from motorgrad.schema import Part, check_fields

MAX_CALLS = 8
SPECS = filter(None, map(importlib.util.find_spec, ("motorgrad", "timsim", "timlab", "motorgrad_thesis")))
ROOTS = [Path(spec.origin).parent for spec in SPECS]


def calls_to(name, value, given):
    """The functions of ours that are being called when the value of a field is first checked, the outermost first.

    **Arguments:** the `name` of the field; the `value`; the function that is `given` it.
    """
    found = []

    def look(frame, event, _):
        if event != "call" or frame.f_code not in CHECKS or found:
            return
        part = frame.f_locals.get("part", frame.f_locals.get("instance"))
        if frame.f_locals.get("name", name) == name and vars(part).get(name) == value:
            while frame is not None:
                if is_ours(frame.f_code):
                    found.insert(0, f"{Path(frame.f_code.co_filename).stem}.{frame.f_code.co_qualname}")
                frame = frame.f_back

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        with contextlib.suppress(SystemExit):  # of a command that only checks
            given()
    finally:
        sys.setprofile(before)
    return found


def is_ours(code):
    """Whether code is a function of one of the packages, and no comprehension."""
    return not code.co_name.startswith("<") and any(root in Path(code.co_filename).parents for root in ROOTS)


def assert_short(calls):
    """At most eight calls, no function twice, and the last is the field's own check."""
    assert calls
    assert len(calls) <= MAX_CALLS, calls
    assert len(set(calls)) == len(calls), calls


CHECKS = (inspect.unwrap(Part.__check_init__).__globals__["check_part_field"].__code__, check_fields.__code__)
"""What checks a field of a part, and the fields of anything else."""
