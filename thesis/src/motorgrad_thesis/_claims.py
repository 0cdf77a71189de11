"""Claims: a quantity that was measured, the range in which it should lie, and the verdict."""

import dataclasses
import functools
import math
from collections.abc import Iterable
from typing import Any, Literal, TypedDict, Unpack, get_args

from motorgrad._errors import choice
from motorgrad.schema import Settings, static
from motorgrad.statistics import LEVEL, Measured, tally_of

Verdict = Literal["holds", "refuted", "undecided"]
"""Whether the measurement supports a claim."""

VERDICTS: tuple[Verdict, ...] = ("holds", "refuted", "undecided")

Kind = Literal["thesis", "extension", "reference model"]
"""Whose statement a claim is: the thesis's; our own, about what goes beyond it; or a number of another implementation,
published or not."""

OURS = "our own expectation"
MODEL = "an independent model"


@dataclasses.dataclass(frozen=True)
class Claim(Settings):
    """A statement, the quantity that decides it, and the range in which that should lie. The verdict follows.

    `above`, `at_least`, `below`, `at_most`, `within`, `more_than_half` and `in_every` make claims.
    """

    statement: str = static(help="in our own words")
    measured: Measured = static(help="the quantity, with its interval")
    quantity: str = static("", help="what was measured, in words, where statement and unit do not say it")
    unit: str = static("", help="unit of the quantity")
    note: str = static("", help="what a reader must know to judge the claim")
    source: str = static(
        "",
        help="where the statement is made; by default that of the experiment for a statement of the thesis, "
        "else a description of the kind",
    )
    low: float = static(-math.inf, help="lower bound of the range; infinite for none")
    high: float = static(math.inf, help="upper bound of the range; infinite for none")
    closed: bool = static(False, help="whether the range contains its bounds")
    kind: Kind = static("thesis", help='whose statement it is: `"thesis"`, `"extension"` (ours) or `"reference model"`')
    of: str = static(
        "",
        help="the statement of which this claim is one variant, where an experiment tests it in several (for each "
        "decay, pool or layout); the variants share these words. By default the claim's own statement",
    )
    untested: str = static(
        "", help="why the measurement does not test the statement by the thesis's own settings; empty where it does"
    )

    def __post_init__(self) -> None:
        choice("kind", self.kind, get_args(Kind))
        # NumPy's own numbers cannot be written to a file
        object.__setattr__(self, "low", float(self.low))
        object.__setattr__(self, "high", float(self.high))

    @property
    def verdict(self) -> Verdict:
        """`"holds"` if the whole interval lies in the range, `"refuted"` if it lies outside, else `"undecided"`: it
        contains a bound, does not reach 95 %, or the quantity is unknown."""
        low, high = self.measured.low, self.measured.high
        if self.measured.level < LEVEL or math.isnan(self.measured.value):
            return "undecided"
        if _beyond(low, self.low, self.closed) and _beyond(-high, -self.high, self.closed):
            return "holds"
        # a number that is no estimate cannot be undecided
        return "refuted" if high < self.low or low > self.high or self.measured.level == 1 else "undecided"

    @property
    def holds(self) -> bool:
        """Whether the verdict is `"holds"`."""
        return self.verdict == "holds"

    @property
    def criterion(self) -> str:
        """What must be measured for the claim to hold, in words."""
        low, high = (f"{bound:.6g}".replace("-", "−") for bound in (self.low, self.high))
        if self.high == math.inf:
            words = f"at least {low}" if self.closed else f"above {low}"
        elif self.low == -math.inf:
            words = f"at most {high}" if self.closed else f"below {high}"
        elif self.low == self.high:
            words = f"equal to {low}"
        else:
            words = f"within ±{high}" if self.low == -self.high else f"between {low} and {high}"
        return f"{self.quantity} {words}".lstrip()

    @property
    def finding(self) -> str:
        """What was measured, in words."""
        return self.measured.words(self.unit)

    def record(self) -> dict[str, Any]:
        """Everything as a table, with what follows from the rest."""
        derived = {"verdict": self.verdict, "criterion": self.criterion, "finding": self.finding}
        return dataclasses.asdict(self) | derived


def claim_source(claim: Claim, thesis: str) -> str:
    """Where a claim is made, in words; `thesis` is the place of a statement of the thesis that names none."""
    return claim.source or {"thesis": thesis, "extension": OURS, "reference model": MODEL}[claim.kind]


def _beyond(value: float, bound: float, closed: bool) -> bool:
    return value > bound or (value == bound and (closed or math.isinf(bound)))


class More(TypedDict, total=False):
    """Arguments of `Claim` that the functions below pass on."""

    note: str
    source: str
    kind: Kind
    of: str
    untested: str


def above(
    bound: float,
    statement: str,
    measured: Measured,
    quantity: str = "",
    unit: str = "",
    **more: Unpack[More],
) -> Claim:
    """A claim that a quantity exceeds `bound`; the other arguments are those of `Claim`."""
    return Claim(statement, measured, quantity, unit, low=bound, **more)


def at_least(
    bound: float,
    statement: str,
    measured: Measured,
    quantity: str = "",
    unit: str = "",
    **more: Unpack[More],
) -> Claim:
    """A claim that a quantity is `bound` or more; the other arguments are those of `Claim`."""
    return Claim(statement, measured, quantity, unit, low=bound, closed=True, **more)


def below(
    bound: float,
    statement: str,
    measured: Measured,
    quantity: str = "",
    unit: str = "",
    **more: Unpack[More],
) -> Claim:
    """A claim that a quantity is less than `bound`; the other arguments are those of `Claim`."""
    return Claim(statement, measured, quantity, unit, high=bound, **more)


def at_most(
    bound: float,
    statement: str,
    measured: Measured,
    quantity: str = "",
    unit: str = "",
    **more: Unpack[More],
) -> Claim:
    """A claim that a quantity is `bound` or less; the other arguments are those of `Claim`."""
    return Claim(statement, measured, quantity, unit, high=bound, closed=True, **more)


def within(
    low: float,
    high: float,
    statement: str,
    measured: Measured,
    quantity: str = "",
    unit: str = "",
    **more: Unpack[More],
) -> Claim:
    """A claim that a quantity lies from `low` to `high`; the other arguments are those of `Claim`."""
    return Claim(statement, measured, quantity, unit, low=low, high=high, closed=True, **more)


positive = functools.partial(above, 0)
"""A claim that a quantity exceeds 0."""
negative = functools.partial(below, 0)
"""A claim that a quantity is less than 0."""


def more_than_half(
    statement: str,
    measured: Measured,
    quantity: str = "share of seeds",
    unit: str = "",
    **more: Unpack[More],
) -> Claim:
    """A claim that something is so most often: that a share exceeds one half."""
    return above(0.5, statement, measured, quantity, unit, **more)


def in_every(
    statement: str,
    happened: Any,
    quantity: str = "share of these seeds",
    unit: str = "",
    **more: Unpack[More],
) -> Claim:
    """A claim that something happened in every seed at hand, given a boolean for each."""
    return within(1, 1, statement, tally_of(happened), quantity, unit, **more)


def count_verdicts(verdicts: Iterable[str]) -> str:
    """How many claims hold, are refuted, and are undecided, in words."""
    found = list(verdicts)
    holds, refuted, undecided = (found.count(verdict) for verdict in VERDICTS)
    return f"{holds} of {len(found)} claims hold, {refuted} refuted, {undecided} undecided"
