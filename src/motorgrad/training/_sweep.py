"""Sweeps: several settings of a learner's numbers in one compiled call."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import PyTree

from motorgrad._errors import check, unknown
from motorgrad.learning import Learner
from motorgrad.schema import Part, check_rounded, fields_of, full_path, numbers_of, with_number
from motorgrad.tasks import Task
from motorgrad.training.engines import validate_needs

Setting = dict[str, float]
Sweep = Mapping[str, Sequence[float]] | Sequence[Mapping[str, float]]
"""Numbers that combine as a product, by path; or a list of settings."""


def sweep_settings(sweep: Sweep, task: Task, agent: Learner) -> list[Setting]:
    """The settings of a sweep, each a mapping from paths to numbers, in the order of the lanes: in a product, the last
    path changes fastest. **Raises** `ValueError` for an unknown path, a static one, and for impossible numbers."""
    wanted = 'paths and lists of numbers, such as {"optimizer.learning_rate": [1e-3, 1e-2]}, or a list of settings'
    if isinstance(sweep, Mapping):
        for name, values in sweep.items():
            listed = isinstance(values, Sequence | np.ndarray) and not isinstance(values, str) and len(values) > 0
            check(listed, f"sweep[{name!r}]", values, "a list of numbers")
        paths = [_path(name, agent) for name in sweep]
        found = [dict(zip(paths, values, strict=True)) for values in itertools.product(*sweep.values())]
    else:
        valid = (
            isinstance(sweep, Sequence) and not isinstance(sweep, str) and all(isinstance(s, Mapping) for s in sweep)
        )
        check(valid, "sweep", sweep, wanted)
        given = [setting for setting in sweep if isinstance(setting, Mapping)]
        paths = {name: _path(name, agent) for name in dict.fromkeys(name for setting in given for name in setting)}
        found = [{paths[name]: value for name, value in setting.items()} for setting in given]
    check(found and all(found), "sweep", sweep, wanted)
    check(all(set(setting) == set(found[0]) for setting in found), "sweep", sweep, "settings of the same numbers")
    settings = []
    dtype = agent.precision
    exact = _possible(check_rounded, agent, dtype)
    for setting in found:
        changed, rounded = agent, exact
        for path, value in setting.items():
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            check(number, f"sweep[{path!r}]", value, "a number")
            changed = with_number(changed, path, float(value))
            if rounded is not None:  # a shorter way to the same as below, for all that is possible
                rounded = _possible(with_number, rounded, path, float(np.asarray(value, dtype)))
        validate_needs(task, check_rounded(changed, dtype) if rounded is None else rounded)
        settings.append({path: float(value) for path, value in setting.items()})
    distinct = len({tuple(setting.items()) for setting in settings}) == len(settings)
    check(distinct, "sweep", sweep, "without a setting that occurs twice")
    return settings


def swept_names(sweep: object) -> list[str]:
    """The names of the settings in a sweep, which need not be checked yet."""
    each = [sweep] if isinstance(sweep, Mapping) else sweep if isinstance(sweep, Sequence) else []
    return list(dict.fromkeys(str(name) for one in each if isinstance(one, Mapping) for name in one))


def numbers_by_lane(settings: Sequence[Setting], seeds: int) -> dict[str, np.ndarray]:
    """The numbers of every lane, by path: all seeds of the first setting, then those of the second …"""
    if not settings:
        return {}
    return {path: np.repeat([setting[path] for setting in settings], seeds) for path in settings[0]}


def setting_text(setting: Mapping[str, float]) -> str:
    """A setting of a sweep in a few words."""
    return ", ".join(f"{path.rpartition('.')[2]} = {value:g}" for path, value in setting.items()) or "the only setting"


def sweepable(name: str, agent: Learner) -> bool:
    """Whether a setting of the agent, by its path or short name, is a number that a sweep can vary."""
    return full_path(type(agent), name) in _numbers(agent.hyperparameters)


def _numbers(tree: PyTree) -> dict[str, Any]:
    return {path: value for path, value in numbers_of(tree).items() if np.ndim(value) == 0}


def _possible(make: Callable[..., Learner], *arguments: object) -> Learner | None:
    """The agent that is made, if it is possible."""
    try:
        return make(*arguments)
    except ValueError:
        return None


def _path(name: str, agent: Learner) -> str:
    """The path of a number, which may be given by its short name."""
    path = full_path(type(agent), name)
    tree = agent.hyperparameters
    known = _numbers(tree)
    if path in known:
        return path
    node: Any = tree
    for part in path.split("."):
        if not isinstance(node, Part) or part not in fields_of(type(node)):
            ends = [path for path in known if path.endswith(f".{name}")]
            if ends:
                raise ValueError(f"unknown number in the sweep {name!r}: did you mean {' or '.join(ends)}?")
            short = [short for short, path in agent.aliases.items() if path in known]
            raise unknown("number in the sweep", name, [*known, *short])
        node = getattr(node, part)
    if node is None:
        raise ValueError(f"sweep: {name!r} is absent in this agent: give it a value first")
    raise ValueError(
        f"sweep: {name!r} is part of the structure, not a number: lengths, intervals, counts and kinds of parts are "
        "the same for all seeds of a run; train one run for each value"
    )
