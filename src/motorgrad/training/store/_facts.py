"""What a configuration and a checkpoint must say: anyone can write a file whose checksum is right."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from motorgrad._errors import check, check_integer
from motorgrad.schema import Settings, build, count, static
from motorgrad.training.store._metrics import PART

MAX_DECISIONS = 2**32
FACTS = {
    "decision": int,
    "recorded": int,
    "wall": float,
    "config": dict,
    "begins": {"structure": dict, "initial": str},
    "provenance": {"sessions": int, "checksum": str},
    "initial": str,
    "versions": dict,
    "metrics": {"length": int, "checksum": str},
}
"""The facts in a checkpoint, with their types."""


@dataclasses.dataclass(frozen=True)
class _Run(Settings):
    """The table `run` of a configuration."""

    steps: int = count(low=1, high=MAX_DECISIONS)
    seeds: tuple[int, ...] = static()
    window: int = count(low=1, high=MAX_DECISIONS)
    envs: int = count(1, 1, MAX_DECISIONS)
    initial: str | None = None
    evaluate_every: int | None = count(None, 1, MAX_DECISIONS)
    evaluate_episodes: int = count(10, 1, MAX_DECISIONS)
    evaluate_seed: int = count(1, high=MAX_DECISIONS)
    evaluate_mode: Literal["sample", "mode"] = "sample"
    keep_best: str | None = None
    keep_least: bool = False


def check_config(config: Mapping[str, Any]) -> None:
    """Refuse a configuration that is none of a run. **Raises** `ValueError`."""
    check({"run", "task", "agent"} <= set(config), "tables", list(config), "run, task and agent")
    check(isinstance(config["run"], dict), "run", config["run"], "a table")
    run = build(_Run, config["run"], "run")
    check(run.seeds, "run.seeds", run.seeds, "one seed at least")
    for name, key in (("task", "name"), ("agent", "policy")):
        check(isinstance(config[name], dict) and key in config[name], name, config[name], f"a table with {key}")
    settings = config.get("sweep", [])
    right = isinstance(settings, list) and all(
        isinstance(setting, dict) and all(isinstance(value, int | float) for value in setting.values())
        for setting in settings
    )
    check(right, "sweep", settings, "a list of tables of numbers")


def facts_of(
    path: Path, arrays: dict[str, np.ndarray], about: dict[str, Any]
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """A checkpoint that was read from a file. **Raises** `ValueError` where a fact in it is missing or impossible."""
    try:
        _check(about, FACTS)
        check(about["decision"] == int(path.stem), "decision", about["decision"], "as the file's name says")
        check(about["recorded"] <= about["decision"], "recorded", about["recorded"], f"at most {about['decision']}")
        known = all(isinstance(version, str) for version in about["versions"].values())
        check(known, "versions", about["versions"], "a table of texts")
        short = about.get("short", "")
        right = isinstance(short, list) and len(short) == 2 and all(isinstance(each, str) for each in short)
        right = right and PART.fullmatch(short[0]) is not None
        check(short is None or right, "short", short, "none, or the name and the checksum of a file of records")
        _check_seconds("cpu", about.get("cpu", 0.0))
        check_config(about["config"])
    except ValueError as error:
        raise ValueError(f"{path}: not a checkpoint of a run: {error}") from None
    return arrays, about


def learner_of(path: Path, about: dict[str, Any]) -> dict[str, Any] | None:
    """The learner that is stored beside the initial policies. **Raises** `ValueError` where it is none."""
    learner = about.get("learner")
    given = learner if isinstance(learner, dict) else {}
    right = isinstance(given.get("structure"), dict) and isinstance(given.get("interface", {}), dict)
    if learner is not None and not (right and isinstance(given.get("initial"), str)):
        raise ValueError(f"{path}: holds no learner with a structure and the fingerprint of its beginning")
    return learner


def _check(found: Mapping[str, Any], wanted: Mapping[str, Any], where: str = "") -> None:
    for name, kind in wanted.items():
        value = found.get(name)
        place = f"{where}{name}"
        if kind is int:
            check_integer(place, value, 0, MAX_DECISIONS)
        elif kind is float:
            _check_seconds(place, value)
        elif isinstance(kind, dict):
            check(isinstance(value, dict), place, value, "a table")
            _check(found[name], kind, f"{place}.")
        else:
            check(isinstance(value, kind), place, value, "a table" if kind is dict else "a text")


def _check_seconds(name: str, value: object) -> None:
    right = isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < math.inf
    check(right, name, value, "seconds")
