"""Runs what the documentation says was run, and compares its numbers: `python -m tools.documented_numbers [PAGE ...]`.

The Python of a page is run as it stands there, in an empty folder, and expressions of what it leaves behind give the
numbers. They are rounded to the digits of the page. Every number that differs is named, with both values, and the exit
status is 1. A sentence with numbers that were measured names the commit whose code made them.

`--long` also runs what takes more than about three minutes of processor time; `--list` says what there is.
"""

import argparse
import dataclasses
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
NUMBER = r"(\d[\d,]*(?:\.\d+)?)"
COMMIT = r"([0-9a-f]{8})"


@dataclasses.dataclass(frozen=True)
class Claim:
    """A sentence of a page and what its numbers are.

    **Arguments:** the `page`; the `blocks` of Python in it that are run, from 0 on, one after the other; the
    `sentence`, with `{name}` for each number and `{commit}` for the commit if they were measured, with any white space;
    `values`, an expression for each name; `then`, code before them; whether it is `long`.
    """

    page: str
    blocks: tuple[int, ...]
    sentence: str
    values: Mapping[str, str]
    then: str = ""
    long: bool = False


FILMS = {
    "hexapod-learns-to-walk": "A hexapod walks with 24 muscles](tasks/hexapod-proprioception.md)",
    "hexapod-walks-with-four-units": "A hexapod walks with four units](tasks/hexapod-synergy.md)",
    "hopper-learns-to-hop": "A hopper hops](tasks/hopper.md)",
    "arm-learns-to-reach": "An arm reaches for targets](bring-your-own-body.md)",
}
"""What the gallery says beneath each film, before its number."""

CLAIMS = (
    Claim(
        "README.md",
        (0,),
        "Their hops rise from {before} m to a median of {median} m ({least} to {most} m; commit {commit}).",
        {
            "before": "np.median(before)",
            "median": "np.median(after)",
            "least": "after.min()",
            "most": "after.max()",
        },
        "after = mg.evaluate(run, steps=1000).metrics['apex']\n"
        "before = mg.evaluate(run, steps=1000, untrained=True).metrics['apex']",
    ),
    Claim(
        "README.md",
        (1,),
        "Before learning, the pole stays up for {before} steps (median of ten seeds). After 20,000 decisions per seed, "
        "all ten reach {least}, the most possible (commit {commit}).",
        {"before": "np.median(before)", "least": "after.min()"},
        "after = mg.evaluate(run, episodes=20, mode='mode').means()\n"
        "before = mg.evaluate(run, episodes=20, untrained=True).means()",
    ),
    Claim(
        "docs/bring-your-own-body.md",
        (0, 1, 2),
        "the hand is within 3 cm of its target at {practice} % of the decisions (median of four seeds; {low} to {high}"
        " %), the movement from the random pose included. Evaluated afterwards on fresh targets by the most probable "
        "actions, over 20 episodes of each seed, it is {median} % ({least} to {most} %; commit {commit}).",
        {
            "practice": "np.median(practice)",
            "low": "practice.min()",
            "high": "practice.max()",
            "median": "np.median(after)",
            "least": "after.min()",
            "most": "after.max()",
        },
        "practice = 100 * run.final('solved', 0.1)\n"
        "after = 100 * mg.evaluate(run, episodes=20, mode='mode').means('solved')",
    ),
    *(
        Claim(
            "docs/gallery.md",
            (),
            f"[{words}: {{decisions}} decisions",
            {"decisions": f"DECISIONS[{film!r}]"},
            "from tools.figures.films import DECISIONS",
        )
        for film, words in FILMS.items()
    ),
)


def main(arguments: list[str]) -> int:
    options = argparse.ArgumentParser(
        prog="python -m tools.documented_numbers", description=(__doc__ or "").partition("\n")[0]
    )
    options.add_argument("pages", nargs="*", help="only these pages, such as README.md")
    options.add_argument("--long", action="store_true", help="also what takes more than three minutes")
    options.add_argument("--list", action="store_true", help="only say what there is")
    given = options.parse_args(arguments)
    chosen = [each for each in CLAIMS if not given.pages or each.page in given.pages]
    if given.list:
        for claim in chosen:
            print(f"{claim.page}{' (long)' * claim.long}: {claim.sentence}")
        return 0
    left = [each for each in chosen if each.long and not given.long]
    for claim in left:
        print(f"not run, --long does: {claim.page}: {claim.sentence}")
    wrong = []
    for claim in (each for each in chosen if each not in left):
        started = time.process_time()
        found = list(differences(claim))
        wrong += found
        for said in found:
            print(said)
        print(f"{claim.page}: {len(claim.values)} numbers, {time.process_time() - started:,.0f} s of processor time")
    return 1 if wrong else 0


def differences(claim: Claim) -> Iterator[str]:
    """The numbers of a claim that the page has otherwise, in words."""
    stated = stated_in(claim)
    if stated is None:
        yield f"{claim.page}: does not say: {claim.sentence}"
        return
    if "commit" in stated and not _is_commit(stated["commit"]) and (ROOT / ".git").exists():
        yield f"{claim.page}: commit {stated['commit']}: there is none"
    for name, value in measured(claim).items():
        if not agrees(stated[name], value):
            yield f"{claim.page}: {name}: the page says {stated[name]}, the run gives {value:.6g}"


def _is_commit(name: str) -> bool:
    return subprocess.run(["git", "cat-file", "-e", name], cwd=ROOT, capture_output=True).returncode == 0


def stated_in(claim: Claim) -> dict[str, str] | None:
    """What the page says for each name in a sentence; `None` where the sentence is not there."""
    page = " ".join((ROOT / claim.page).read_text().split())
    pattern = ""
    names = []
    for part in re.split(r"(\{\w+\})", " ".join(claim.sentence.split())):
        if re.fullmatch(r"\{\w+\}", part):
            names.append(part[1:-1])
            pattern += COMMIT if part == "{commit}" else NUMBER
        else:
            pattern += re.escape(part)
    found = re.search(pattern, page)
    return None if found is None else dict(zip(names, found.groups(), strict=True))


def agrees(written: str, value: float) -> bool:
    """Whether a number as it is written, such as "1,200" or "0.81", is a value rounded to its digits."""
    digits = len(written.partition(".")[2])
    return f"{float(value):,.{digits}f}".replace("-0", "0") == f"{float(written.replace(',', '')):,.{digits}f}"


def python_in(page: str) -> list[str]:
    """The blocks of Python on a page."""
    return re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(), re.DOTALL | re.MULTILINE)


def measured(claim: Claim) -> dict[str, float]:
    """Run the blocks of a claim in an empty folder, and evaluate its expressions."""
    blocks = python_in(claim.page)
    here = Path.cwd()
    import motorgrad as mg  # which pages import in their first block

    names: dict[str, Any] = {"mg": mg}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for index in claim.blocks:
                exec(compile(blocks[index], f"{claim.page}, block {index}", "exec"), names)
            exec(f"import numpy as np\n{claim.then}", names)
            return {name: float(eval(expression, names)) for name, expression in claim.values.items()}
        finally:
            os.chdir(here)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
