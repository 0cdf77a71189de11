"""The score: how many statements of the thesis hold, each counted once, however many claims decide it."""

import collections
import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

NOT_TESTABLE = "not testable"
NOT_RUN = "not run yet"
STANDINGS = ("holds", "refuted", "undecided", NOT_TESTABLE, NOT_RUN)
"""How a statement may stand: a verdict; not testable, because no claim tests it by the thesis's own settings; or not
run yet, because what is recorded is older than the claim."""

HEADS = ("part", "statements", "hold", "refuted", "undecided", NOT_TESTABLE, NOT_RUN)


@dataclasses.dataclass(frozen=True)
class Statement:
    """A statement of the thesis, and how it stands.

    - `experiment`: name of the experiment that tests it; `part`: the chapter or appendix.
    - `words`: the statement; `source`: where the thesis makes it.
    - `claims`: number of claims that decide it; `standing`: one of `STANDINGS`.
    - `reasons`: if it is not testable, why; if it is refuted, what was found.
    """

    experiment: str
    part: str
    words: str
    source: str
    claims: int
    standing: str
    reasons: tuple[str, ...]


def standing(claims: Iterable[Mapping[str, Any]]) -> str:
    """How a statement stands that these records of claims decide together.

    A statement says that all of its variants are so. It is refuted if one of them is, undecided if one is and none is
    refuted, and holds if all hold. Variants that do not test it are left out; if all are, it is not testable.
    """
    verdicts = {claim["verdict"] for claim in claims if not claim["untested"]}
    return next((each for each in (NOT_RUN, "refuted", "undecided", "holds") if each in verdicts), NOT_TESTABLE)


def statements(records: Iterable[Mapping[str, Any]]) -> list[Statement]:
    """The statements of the thesis that these records of experiments judge, in order.

    Claims of an experiment about the same statement (`of`, or else the claim's own words) are its variants.
    """
    found = []
    for record in records:
        variants: dict[str, list[Mapping[str, Any]]] = {}
        for claim in record["claims"]:
            if claim["kind"] == "thesis":
                variants.setdefault(claim["of"] or claim["statement"], []).append(claim)
        for words, claims in variants.items():
            stands = standing(claims)
            why = [claim["untested"] for claim in claims if stands == NOT_TESTABLE]
            why += [claim["finding"] for claim in claims if stands == claim["verdict"] == "refuted"]
            sources = dict.fromkeys(claim["source"] for claim in claims)
            found.append(
                Statement(
                    record["name"],
                    record["part"],
                    words,
                    "; ".join(sources),
                    len(claims),
                    stands,
                    tuple(dict.fromkeys(why)),
                )
            )
    return found


def score_words(found: Sequence[Statement]) -> str:
    """How many statements stand how, in words: "of 12 statements of the thesis, 9 hold, 2 are refuted, …"."""
    counts = collections.Counter(each.standing for each in found)
    verbs = {"holds": "hold", "refuted": "are refuted", "undecided": "are undecided"}
    parts = [
        f"{counts[name]} {verbs.get(name, f'are {name}')}" for name in STANDINGS if name != NOT_RUN or counts[name]
    ]
    return f"of {len(found)} statements of the thesis, {', '.join(parts)}"


def score_rows(found: Sequence[Statement]) -> list[tuple[str | int, ...]]:
    """The rows of the table of the score, under `HEADS`: a row for each part of the thesis, and one for all."""
    parts: dict[str, list[Statement]] = {}
    for each in found:
        parts.setdefault(each.part.replace("-", " "), []).append(each)
    return [_row(name, own) for name, own in [*parts.items(), ("all", list(found))]]


def _row(name: str, found: Sequence[Statement]) -> tuple[str | int, ...]:
    counts = collections.Counter(each.standing for each in found)
    return (name, len(found), *(counts[each] for each in STANDINGS))
