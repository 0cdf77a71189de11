"""`motorgrad reproduce NAME…`: reproduce figures and claims of the thesis."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

from motorgrad._errors import check, plain
from motorgrad._extras import FILM, require
from motorgrad._files import check_writable
from motorgrad._signals import unfinished
from motorgrad.options import (
    Arguments,
    failure_text,
    json_help,
    listed_failures,
    read_arguments,
    resolve,
    write_json,
)
from motorgrad.options.executors import ExecutorOptions
from motorgrad.schema import static
from motorgrad_thesis import (
    EXPERIMENTS,
    Reproductions,
    count_verdicts,
    reproduce_all,
    score_words,
    select_experiments,
    statements,
)

MARKS = {"holds": "✓", "refuted": "✗", "undecided": "?"}


@dataclasses.dataclass(frozen=True)
class Reproduce(ExecutorOptions):
    """Run experiments, draw their figures and check their claims; then write a one-page report on everything in the
    folder. Finished experiments are not run again; interrupted ones continue. A failing experiment is tried again, then
    set aside, and the others continue. motorgrad reproduce NAME --help shows the settings of one experiment."""

    experiments: tuple[str, ...] = static(
        positional="NAME ...",
        help="Names of experiments (motorgrad list), chapter-5 or appendix-a for those of a part, or all",
    )
    out: Path | None = static(
        None, help="The folder, by default runs/reproduce, or runs/reproduce-quick for a smoke test"
    )
    quick: bool = static(
        False, help="A smoke test: small sizes, a minute or two for all experiments, meaningless numbers"
    )
    strict: bool = static(False, help="Exit with status 1 if a claim is refuted or undecided")
    animate: bool = static(
        False, help="Also film the learning of particles, in experiments that have them: animation.mp4 in their folders"
    )
    json: Path | None = static(None, help=json_help("claims, numbers and versions"))

    def validate(self) -> None:
        super().validate()
        allowed = "the names of experiments, or all; motorgrad list has them"
        check(self.experiments, "experiments", self.experiments, allowed)
        select_experiments(self.experiments, EXPERIMENTS)
        check_writable("out", self.folder, folder=True)
        if self.animate:
            require(*FILM)

    @property
    def folder(self) -> Path:
        return self.out or Path("runs") / ("reproduce-quick" if self.quick else "reproduce")


def run(arguments: list[str]) -> int:
    given = read_arguments(arguments)
    options = resolve(_command(given), given, "reproduce")
    names = _available(options.experiments)
    out = options.folder
    settings = getattr(options, "settings", None)
    kinds = [EXPERIMENTS[name] for name in names]
    chosen = [settings or (kind.quick() if options.quick else kind()) for kind in kinds]
    how = {"quick": options.quick, "films": options.animate, **options.how}
    made = unfinished("results", lambda: reproduce_all(chosen, out, **how))
    stopped = not made.complete and not made.failures
    if stopped:
        print(f"stopped; everything is saved in {out}, and the same command continues", file=sys.stderr)
        return 130
    if str(options.json) != "-":
        _print(made)
    experiments = [each.record() for each in made.done]
    failures = listed_failures(made.failures)
    write_json(options.json, {"report": str(made.report), "experiments": experiments, "failures": failures})
    refuted = options.strict and not all(claim.holds for each in made.done for claim in each.claims)
    return 1 if made.failures or refuted else 0


def _available(experiments: Sequence[str]) -> list[str]:
    """The chosen experiments, without those that need a missing package.

    Of a chapter or of all, these are skipped with a message. **Raises** `RuntimeError` for one that is named.
    """
    names = select_experiments(experiments, EXPERIMENTS)
    lacking = {name: lacks for name in names if (lacks := EXPERIMENTS[name].lacks())}
    for name, lacks in lacking.items():
        if name in map(str.lower, experiments):
            raise RuntimeError(lacks)
        print(f"skipped: {lacks}", file=sys.stderr)
    return [name for name in names if name not in lacking]


def _command(given: Arguments) -> type[Reproduce]:
    """The options, with the settings of the experiment where a single one is named (`--settings.seeds 32`)."""
    named = [word for word in given.rest if word.lower() in EXPERIMENTS]
    names = named or given.table.get("experiments", [])
    if not isinstance(names, list) or len(names) != 1 or str(names[0]).lower() not in EXPERIMENTS:
        several = any(word.startswith("--settings") for word in given.rest) or "settings" in given.table
        check(not several, "settings", names, "given where a single experiment is named")
        return Reproduce
    kind = EXPERIMENTS[str(names[0]).lower()]
    if not dataclasses.fields(kind):
        return Reproduce
    quick = "--quick" in given.rest or given.table.get("quick") is True
    default = kind.quick() if quick else kind()
    field = ("settings", kind, dataclasses.field(default=default))
    return dataclasses.make_dataclass(
        "Reproduce", [field], bases=(Reproduce,), frozen=True, namespace={"__doc__": Reproduce.__doc__}
    )


def _print(made: Reproductions) -> None:
    if any(each.quick for each in made.done):
        print("A smoke test: everything has run, but the numbers and verdicts mean nothing.")
    for each in made.done:
        judged = f": {count_verdicts(claim.verdict for claim in each.claims)}" if each.claims else ""
        print(f"\n{each.experiment.source}, {each.experiment.title}{judged}  {each.figure}")
        for film in each.films:
            print(f"  filmed: {film}")
        for claim in each.claims:
            print(f"  {MARKS[claim.verdict]} {claim.statement}")
            print(f"      expected {claim.criterion}; measured {claim.finding}")
    if judged := statements(each.record() for each in made.done):
        print(f"\n{score_words(judged)}".replace("of", "Of", 1))
    for failure in made.failures:
        print(f"\n{failure_text(failure)}")
    print(f"\nreport: {plain(made.report)}")
