"""What the tests of all experiments share: each is run once at its smoke size, and leaves the same things behind.

Pytest ends where a conftest.py that it starts with cannot be imported, so fixtures import the experiments.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from motorgrad_thesis import Reproduction


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    """One folder for a file of tests, so that its experiments share trained runs."""
    return tmp_path_factory.mktemp("reproduced")


@pytest.fixture(scope="module")
def done(out) -> Callable[[str], Reproduction]:
    """An experiment by its name, made when it is first asked for."""
    from motorgrad_thesis import EXPERIMENTS, reproduce

    made: dict[str, Reproduction] = {}

    def of(name: str) -> Reproduction:
        if name not in made:
            made[name] = reproduce(EXPERIMENTS[name].quick(), out, quick=True, progress=False)
        return made[name]

    return of


def _said(words: Iterable[str]) -> set[str]:
    """Statements without their numbers, which a smoke test may have others of."""
    return {re.sub(r"[\d.]+", "#", each) for each in words}


@pytest.fixture(scope="session")
def on_record() -> dict[str, set[str]]:
    """The statements of the thesis on record for the page about the reproduction, by experiment."""
    data = json.loads((Path(__file__).parents[2] / "docs" / "data" / "reproduction.json").read_text())
    return {name: _said(each["words"] for each in found) for name, found in data.items()}


@pytest.fixture(scope="session")
def check_complete(on_record) -> Callable[[str, Reproduction], None]:
    """That an experiment left its figure and its settings, that every claim stands on a number and its interval, and
    that every statement of the thesis that it judges is on record."""
    from motorgrad_thesis import EXPERIMENTS, statements

    def check(name: str, found: Reproduction) -> None:
        assert found.figure.read_text().startswith("<?xml")
        assert (found.folder / "figure.png").read_bytes().startswith(b"\x89PNG")
        settings = json.loads(json.dumps(dataclasses.asdict(EXPERIMENTS[name].quick())))
        assert json.loads((found.folder / "record.json").read_text())["settings"] == settings
        assert _said(each.words for each in statements([found.record()])) <= on_record.get(name, set())
        for claim in found.claims:
            unknown = claim.verdict == "undecided" and claim.measured.value != claim.measured.value
            assert unknown or claim.measured.low <= claim.measured.value <= claim.measured.high

    return check
