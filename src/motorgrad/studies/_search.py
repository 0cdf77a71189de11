"""Searches that adapt: Optuna asks for settings in rounds, and every round is a study.

    study.toml                 the study, with its table `search`
    rounds/NNNN/trials.json    what Optuna asked for
    rounds/NNNN/rung-N/        the folder of the study of these settings
    optuna.log                 Optuna's storage, for its dashboard; it is made again from the rounds

A round asks for a fixed number of settings, and tells all their values before the next. Each question has random
numbers of its own. So neither workers nor kills change what is asked.
"""

import dataclasses
import json
import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import tomli_w

from motorgrad._errors import check
from motorgrad._extras import require
from motorgrad._files import read_json, read_toml, write_atomically
from motorgrad.schema import Settings, build, count, inner, static, table
from motorgrad.studies._driver import run_study, whole
from motorgrad.studies._folder import check_folder, locked
from motorgrad.studies._grid import as_given, at_ends, expand, frozen, in_file_order, is_range, leaves, range_in
from motorgrad.studies._partition import partition
from motorgrad.studies._results import Best, Results
from motorgrad.studies._study import Study

if TYPE_CHECKING:
    import optuna  # type: ignore[import-not-found]


@dataclasses.dataclass(frozen=True)
class Search(Settings):
    """A search by Optuna over the ranges and lists of a study's `agent`, for one task."""

    study: Study = inner(
        help='in its `agent`, a table `{"low": 1e-4, "high": 1e-1, "scale": "log"}` is a range, and a list is a choice'
    )
    trials: int = count(low=1, high=10**6, help="settings to try in all")
    batch: int = count(
        8,
        1,
        10**6,
        help="settings of a round, which learn side by side. The next round knows the values of all before it",
    )
    sampler: Literal["tpe", "random"] = static(
        "tpe", help='`"tpe"`, tree-structured Parzen estimators (Bergstra et al., 2011); `"random"`'
    )
    rungs: int = count(
        1,
        1,
        10**6,
        help="of successive halving (Li et al., 2018). At the first of several every setting learns for "
        "steps / reduction^(rungs − 1)",
    )
    reduction: int = count(
        3,
        2,
        10**6,
        help="about one setting in so many goes on to the next rung, where it learns from the start, for so many times "
        "as long",
    )
    metric: str = static(
        "reward",
        help="what is to be best, as in `Results.best`: its mean over every second seed, if there are four or more. "
        "The other seeds report it",
    )
    direction: Literal["maximize", "minimize"] = static("maximize", help="what is best")
    seed: int = count(0, 0, 10**6, help="seed of the search")

    needs: ClassVar[tuple[str, str, str]] = ("a search needs", "optuna", "search")
    """What `require` is given before it runs."""

    def validate(self) -> None:
        check(self.study.cases is None, "cases", self.study.cases, "left out where there is a search")
        check(self.study.design is None, "design", self.study.design, "left out where there is a search")
        alone = len(expand({"task": self.study.task})) == 1
        check(alone, "task", self.study.task, "one task: rewards of several do not compare")
        first = self.steps(0)
        check(first >= 1, "rungs", self.rungs, f"fewer: the first would have {first} steps")

    @staticmethod
    def read(path: Path | str, *, trust: bool = False) -> "Search":
        """The search in the TOML file of a study: its table `search`. **Raises** as `Study.read`."""
        values = read_toml(Path(path))
        study = Study.read(path, trust=trust)
        try:
            own = values.get("search", {})
            check(isinstance(own, Mapping) and "study" not in own, "search", own, "a table of the search's settings")
            return build(Search, {"study": study, **own}, "search")
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    def as_table(self) -> dict[str, Any]:
        """The search as a plain table, as in its file."""
        own = {name: value for name, value in table(self).items() if name != "study"}
        return {**self.study.as_table(), "search": own}

    def steps(self, rung: int) -> int:
        """Decisions per seed at a rung."""
        return self.study.steps // self.reduction ** (self.rungs - 1 - rung)

    def check(self) -> None:
        """Check all choices at both ends of the ranges. **Raises** `ValueError` that names the setting."""
        study = self.study
        points = at_ends(expand({"task": study.task, "agent": study.agent}, ranges=True))
        partition(points, study.steps, study.seeds, study.window, study.lanes)

    def run(self, out: Path | str, **options: Any) -> "SearchResults":
        """Run the search in a folder, or continue it there. `options` as in `run_study`.

        **Raises** `ValueError` and `RunDirectoryError` before any work starts; `RuntimeError` without Optuna; where it
        was asked to stop (Ctrl-C), once all is saved, `KeyboardInterrupt`, whose `results` are those so far.
        """
        path = Path(out)
        _optuna()
        self.check()
        file = path / "study.toml"
        check_folder(path, file.name, "search", self.as_table(), read_toml(file) if file.is_file() else None)
        with locked(path, "search"):
            write_atomically(file, tomli_w.dumps(self.as_table()).encode())
            return whole(_Searching(self, path, options).run())

    @staticmethod
    def load(path: Path | str, *, trust: bool = False) -> "SearchResults":
        """The results of a search in its folder so far."""
        search = Search.read(Path(path) / "study.toml", trust=trust)
        rounds = [
            Results.load(file.parent, trust=trust) for file in sorted(Path(path).glob("rounds/*/rung-*/study.toml"))
        ]
        return SearchResults(Path(path), search, rounds)


class SearchResults:
    """What a search has so far: its `path`, the `search`, and in `rounds` the `Results` of every rung."""

    def __init__(self, path: Path, search: Search, rounds: Sequence[Results]):
        self.path = path
        self.search = search
        self.rounds = list(rounds)

    def __repr__(self) -> str:
        return f"SearchResults({self.path}, {len(self.rounds)} rungs)"

    @property
    def complete(self) -> bool:
        """Whether all trials were made, and no job was set aside."""
        asked = -(-self.search.trials // self.search.batch)
        begun = {results.path.parent for results in self.rounds}
        return len(begun) == asked and all(results.complete for results in self.rounds)

    @property
    def failures(self) -> list[dict[str, Any]]:
        """The jobs that were set aside, in all rounds."""
        return [failure for results in self.rounds for failure in results.failures]

    def best(self, count: int = 5) -> list[Best]:
        """The best settings of all rounds, among those that learned for all steps; see `Results.best`."""
        search = self.search
        found = []
        for results in self.rounds:
            if results.study.steps == search.study.steps and search.metric in results.metrics:
                for best in results.best(search.metric, count, direction=search.direction):
                    agent = dict(leaves({"agent": results.study.points[best.point]["agent"]}))
                    found.append(best._replace(settings=agent))
        sign = 1 if search.direction == "minimize" else -1
        # two rounds may have asked for the same
        each = {frozen(best.settings): best for best in found}
        order = [(math.isnan(best.chosen_by.value), sign * best.chosen_by.value) for best in each.values()]
        ranked = sorted(zip(order, each.values(), strict=True), key=lambda pair: pair[0])
        return [best for _, best in ranked[:count]]


class _Searching:
    """One session of a search."""

    def __init__(self, search: Search, path: Path, options: Mapping[str, Any]):
        self.search, self.path, self.options = search, path, options
        optuna = _optuna()
        log = path / "optuna.log"
        log.unlink(missing_ok=True)
        pruner = optuna.pruners.SuccessiveHalvingPruner(
            min_resource=search.steps(0), reduction_factor=search.reduction, min_early_stopping_rate=0
        )
        self.optuna = optuna
        self.asked = optuna.create_study(
            storage=optuna.storages.JournalStorage(optuna.storages.journal.JournalFileBackend(str(log))),
            direction=search.direction,
            pruner=pruner,
        )

    def run(self) -> SearchResults:
        rounds: list[Results] = []
        for start in range(0, self.search.trials, self.search.batch):
            made, goes_on = self._round(start)
            rounds += made
            if not goes_on:
                break
        return SearchResults(self.path, self.search, rounds)

    def _round(self, start: int) -> tuple[list[Results], bool]:
        """A round: its results by rung, and whether the search goes on."""
        search = self.search
        rounds = []
        folder = self.path / "rounds" / f"{start // search.batch:04d}"
        alive = self._ask(folder, start)
        for rung in range(search.rungs):
            agents = list({frozen(agent): agent for _, agent in alive}.values())
            steps = search.steps(rung)
            study = dataclasses.replace(search.study, agent=[as_given(agent) for agent in agents], steps=steps)
            results = run_study(study, folder / f"rung-{rung}", metric=search.metric, **self.options)
            rounds.append(results)
            if not results.complete and not results.failures:  # it was asked to stop
                return rounds, False
            values = dict(zip(map(frozen, agents), self._values(results), strict=True))
            alive = [
                (trial, agent)
                for trial, agent in alive
                if self._tell(trial, values[frozen(agent)], steps, rung == search.rungs - 1)
            ]
            if not alive:
                break
        return rounds, True

    def _ask(self, folder: Path, start: int) -> list[tuple["optuna.Trial", dict[str, Any]]]:
        """The trials of a round, with their agents."""
        search, samplers = self.search, self.optuna.samplers
        count = min(search.batch, search.trials - start)
        file = folder / "trials.json"
        known = _trials(file, count) if file.exists() else [None] * count
        found = []
        for number, parameters in enumerate(known, start):
            seed = int(np.random.SeedSequence([search.seed, number]).generate_state(1)[0])
            kind = samplers.TPESampler if search.sampler == "tpe" else samplers.RandomSampler
            self.asked.sampler = kind(seed=seed)
            if parameters is not None:
                self.asked.enqueue_trial(parameters)
            trial = self.asked.ask()
            found.append((trial, _suggest(trial, search.study.agent, "agent")))
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(file, json.dumps([trial.params for trial, _ in found], indent=1).encode())
        return found

    def _tell(self, trial: "optuna.Trial", value: float, steps: int, last: bool) -> bool:
        """Tell Optuna the value of a trial. Returns whether the trial goes on to the next rung."""
        states = self.optuna.trial.TrialState
        if not np.isfinite(value):
            self.asked.tell(trial, state=states.FAIL)
            return False
        trial.report(value, steps)
        if last:
            self.asked.tell(trial, value)
            return False
        if trial.should_prune():
            self.asked.tell(trial, state=states.PRUNED)
            return False
        return True

    def _values(self, results: Results) -> np.ndarray:
        """The mean of the metric for every setting over the seeds that choose; NaN where a job was set aside."""
        if self.search.metric not in results.metrics:
            return np.full(len(results.study.points), np.nan)
        return results.choosing(results.values(self.search.metric))[0].mean(axis=1)


def _trials(file: Path, count: int) -> list[dict[str, Any]]:
    """What was asked for in a round. **Raises** `ValueError` for a damaged file."""
    found = read_json(file)
    if not (isinstance(found, list) and len(found) == count and all(isinstance(each, dict) for each in found)):
        raise ValueError(f"{file}: damaged: must list the settings of {count:,} trials; delete the folder of its round")
    return found


def _suggest(trial: "optuna.Trial", value: object, path: str) -> Any:
    """The settings of a trial: ranges and lists replaced by what Optuna suggests, which the order of asking affects."""
    if is_range(value):
        found = range_in(value, path)
        return trial.suggest_float(path, found.low, found.high, log=found.scale == "log")
    if isinstance(value, Mapping):
        return {name: _suggest(trial, item, f"{path}.{name}") for name, item in in_file_order(value).items()}
    if isinstance(value, list | tuple):
        options = {frozen(item): item for item in value}
        chosen = trial.suggest_categorical(path, list(options))
        item = options[chosen]
        return _suggest(trial, item, f"{path}[{list(options).index(chosen)}]") if isinstance(item, Mapping) else item
    return value


def _optuna() -> Any:
    require(*Search.needs)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import optuna  # type: ignore[import-not-found]
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna
