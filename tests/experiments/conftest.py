"""What the tests of all experiments share: each is run once at its smoke size, and leaves the same things behind."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from motorgrad.experiments import EXPERIMENTS, Reproduction, reproduce


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    """One folder for a file of tests, so that its experiments share trained runs."""
    return tmp_path_factory.mktemp("reproduced")


@pytest.fixture(scope="module")
def done(out) -> Callable[[str], Reproduction]:
    """An experiment by its name, made when it is first asked for."""
    made: dict[str, Reproduction] = {}

    def of(name: str) -> Reproduction:
        if name not in made:
            made[name] = reproduce(EXPERIMENTS[name].quick(), out, quick=True, progress=False)
        return made[name]

    return of


@pytest.fixture(scope="session")
def check_complete() -> Callable[[str, Reproduction], None]:
    """That an experiment left its figure and its settings, and that every claim stands on a number and its interval."""

    def check(name: str, found: Reproduction) -> None:
        assert found.figure.read_text().startswith("<?xml")
        assert (found.folder / "figure.png").read_bytes().startswith(b"\x89PNG")
        settings = json.loads(json.dumps(dataclasses.asdict(EXPERIMENTS[name].quick())))
        assert json.loads((found.folder / "record.json").read_text())["settings"] == settings
        for claim in found.claims:
            unknown = claim.verdict == "undecided" and claim.measured.value != claim.measured.value
            assert unknown or claim.measured.low <= claim.measured.value <= claim.measured.high

    return check
