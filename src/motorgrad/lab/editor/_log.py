"""Logs: all that the state of a run follows from, as plain data.

A log has its `seeds`, the `tick` at which it ends, a `digest` of the state there, and `parts`, a `diagram` each, as
text, that ran `from` one tick `until` another, with the `changes` of parameters in it.
"""

from typing import Any

from motorgrad._errors import check
from motorgrad.lab._run import MOST_TICKS

FORMAT = "motorgrad log"


def checked_log(log: Any) -> dict[str, Any]:
    """A log, seen to be one. **Raises** `ValueError` that says what is wrong with it."""
    check(isinstance(log, dict) and log.get("format") == FORMAT, "format", log.get("format"), f"{FORMAT!r}")
    check(log.get("version") == 1, "version", log.get("version"), "1, which this release reads")
    seeds, parts = log.get("seeds"), log.get("parts")
    tick: Any = log.get("tick")
    check(isinstance(seeds, list) and seeds, "seeds", seeds, "a list of integers")
    check(isinstance(tick, int) and 0 <= tick <= MOST_TICKS, "tick", tick, "a whole number from 0")
    check(isinstance(parts, list) and parts, "parts", parts, "a list of at least one part")
    now = 0
    for part in parts or ():
        check(isinstance(part, dict) and isinstance(part.get("diagram"), str), "part", part, "with a diagram")
        check(part.get("from") == now, "from", part.get("from"), f"{now}, where the part before ends")
        last: Any = part.get("until")
        check(isinstance(last, int) and now <= last <= tick, "until", last, f"a whole number in {now} … {tick}")
        check(isinstance(part.get("changes"), list), "changes", part.get("changes"), "a list")
        for change in part["changes"]:
            known = isinstance(change, dict) and set(change) == {"tick", "address", "value"}
            at: Any = change["tick"] if known else None
            check(isinstance(at, int) and now <= at <= last, "change", change, "in order, with tick, address and value")
            now = at
        now = last
    check(now == tick, "tick", tick, f"{now}, where the last part ends")
    return {"digest": None, **log}
