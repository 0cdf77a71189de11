"""Experiments that are done, and judged, under each of several readings of the thesis."""

import abc
import dataclasses
from collections.abc import Iterator, Sequence
from typing import ClassVar, Generic, TypeVar

from motorgrad_thesis._claims import Claim
from motorgrad_thesis._experiment import Experiment, Values, Workspace

Reading = TypeVar("Reading", bound=str)


class Readings(Experiment, Generic[Reading]):
    """Base of experiments under several readings of the thesis: a subclass measures and judges one of them.

    The results of a reading have its name before their own. A statement of the thesis is one statement, of which each
    reading is a variant; `judging` decides it, and `reading` says why.
    """

    judging: ClassVar[str]
    """The reading by which statements of the thesis are judged."""
    what: ClassVar[str]
    """What is read, in words that follow a reading's name."""
    otherwise: ClassVar[str]
    """Why other readings do not test statements of the thesis."""
    modelled: ClassVar[str] = ""
    """The only reading that reference models share; empty if they have nothing to do with it."""

    @property
    @abc.abstractmethod
    def readings(self) -> Sequence[Reading]:
        """The readings, in order."""

    @abc.abstractmethod
    def measure(self, work: Workspace, reading: Reading, /) -> Values:
        """What `run` returns, for one reading."""

    @abc.abstractmethod
    def judge(self, values: Values, reading: Reading, /) -> Iterator[Claim]:
        """The claims about one reading, from its own results."""

    def run(self, work: Workspace) -> Values:
        found = {reading: self.measure(work, reading) for reading in self.readings}
        return {f"{reading} {name}": value for reading, values in found.items() for name, value in values.items()}

    def claims(self, values: Values) -> Iterator[Claim]:
        for reading in self.readings:
            for claim in self.judge(values_of(values, reading), reading):
                if claim.kind != "reference model" or self.modelled in ("", reading):
                    yield self.as_variant(claim, reading)

    @classmethod
    def as_variant(cls, claim: Claim, reading: str) -> Claim:
        """A claim as one about this reading, the variant of a statement that it shares with the others."""
        tests = reading == cls.judging or claim.kind != "thesis"
        return dataclasses.replace(
            claim,
            statement=f"{claim.statement.removesuffix('.')} ({reading} {cls.what}).",
            of=claim.of or claim.statement,
            untested=claim.untested or ("" if tests else cls.otherwise),
        )


def values_of(values: Values, reading: str) -> Values:
    """The results of one reading, under their own names."""
    start = f"{reading} "
    return {name.removeprefix(start): value for name, value in values.items() if name.startswith(start)}
