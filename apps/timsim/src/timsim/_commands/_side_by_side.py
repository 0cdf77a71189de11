"""Options of `motorgrad sim` that put several bodies side by side: seeds, runs and other policies."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from motorgrad._errors import check
from motorgrad.training import load
from timsim.live import side_by_side


def gathered(arguments: Sequence[str]) -> list[str]:
    """The arguments with `--seed` and `--run`, which may be given several times, and lists with commas in one form.

    The first run remains `--run`, others become `--runs-beside`; several seeds become `--seeds`.
    """
    rest: list[str] = []
    found: dict[str, list[str]] = {"--seed": [], "--run": [], "--seeds": []}
    left = list(arguments)
    while left:
        argument, *left = left
        name, joined, value = argument.partition("=")
        if name not in found:
            rest.append(argument)
            continue
        if joined:
            values = [value]
        elif name == "--seeds":
            count = next((place for place, word in enumerate(left) if word.startswith("--")), len(left))
            values = left[:count]
            left = left[count:]
        else:
            check(left, name, "", "followed by a value")
            values = left[:1]
            left = left[1:]
        found[name] += [part for each in values for part in (each.split(",") if name == "--seeds" else [each])]
    seeds = found["--seed"] + found["--seeds"]
    if len(seeds) == 1:
        rest += ["--seed", *seeds]
    elif seeds:
        rest += ["--seeds", *seeds]
    first, *others = found["--run"] or [""]
    return rest + (["--run", first] if first else []) + (["--runs-beside", *others] if others else [])


def bodies(
    run: Path | None,
    runs_beside: Sequence[Path],
    seed: int | None,
    seeds: Sequence[int],
    beside: Sequence[str],
) -> tuple[int, str, dict[str, Any] | None]:
    """The first seed, the label of its body, and the bodies beside it, as `timsim.live.setup_of` takes them.

    **Arguments:** the options of these names.

    **Raises** `ValueError` for seeds that a run does not have.
    """
    given = dict(_labelled(word) for word in beside)
    runs = [path for path in (run, *runs_beside) if path is not None]
    if not runs_beside:
        chosen = seeds or seed
        if chosen is None:
            chosen = load(run).seeds[0] if run else 0
        return side_by_side(run, chosen, given or None)
    names = _names(runs)
    pairs: dict[str, tuple[Path, int]] = {}
    for name, path in zip(names, runs, strict=True):
        known = load(path).seeds
        shown = seeds or ((known[0] if seed is None else seed),)
        pairs |= {name if len(shown) == 1 else f"{name}, seed {each}": (path, each) for each in shown}
    label, (_, first) = next(iter(pairs.items()))
    return first, label, {each: pair for each, pair in pairs.items() if each != label} | given


def _labelled(word: str) -> tuple[str, str]:
    """A label and what it stands for, from `LABEL=PATH` or a path alone."""
    label, separator, what = word.partition("=")
    what = what if separator else word
    return label if separator else (Path(what).stem or what), what


def _names(runs: Sequence[Path]) -> list[str]:
    """The names of run directories, with those of their parents where they would be the same."""
    names = [path.resolve().name for path in runs]
    if len(set(names)) == len(names):
        return names
    names = [f"{path.resolve().parent.name}/{path.resolve().name}" for path in runs]
    check(len(set(names)) == len(names), "run", [str(path) for path in runs], "different directories")
    return names
