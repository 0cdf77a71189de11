"""The speed table, stored and compared: `python -m tools.speed`, from the root of a checkout.

    python -m tools.speed measure                            # every row, some hours; make bench
    python -m tools.speed measure "hopper-*" import          # these
    python -m tools.speed draw                               # the table of docs/performance.md, from what is stored
    python -m tools.speed check --base COMMIT "three-states-*"   # beside a commit; make bench-check BASE=COMMIT

Each row is measured in a process of its own, and stored in `benchmarks` at once, with commit, date and machine. `check`
measures two commits in turn, in processor time, and names the rows that fell by more than their spread; its exit status
is then 1. Without a commit it takes the last tag, if there is one.
"""

import argparse
import subprocess
import sys
from collections.abc import Sequence

from motorgrad._files import write_atomically
from motorgrad.benchmarks import PAIRS, Row, chosen, speed_table
from tools.speed import _check, _store
from tools.speed._processes import ROOT, Failed, git, measure

PROCESSES = 5
"""Pairs of processes that `check` measures of a row."""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tools.speed", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    measuring = commands.add_parser("measure", help="measure rows, store them, draw the table")
    commands.add_parser("draw", help="draw the table from what is stored")
    checking = commands.add_parser("check", help="compare this checkout with a commit")
    checking.add_argument("--base", default="", help="the commit; by default the last tag")
    checking.add_argument("--pairs", type=int, default=PROCESSES, help=f"of processes ({PROCESSES})")
    for each in (measuring, checking):
        each.add_argument("rows", nargs="*", metavar="ROW", help='id or pattern, such as "hopper-*"; by default all')
    options = parser.parse_args(arguments)
    rows = list(speed_table())
    if options.command == "draw":
        draw(rows)
        return 0
    try:
        asked = chosen(rows, options.rows)
    except ValueError as error:
        parser.error(str(error))
    if options.command == "measure":
        return measured(asked, rows)
    if options.pairs < 2:
        parser.error(f"--pairs {options.pairs}: must be at least 2, as pairs have a spread")
    base = options.base or last_tag()
    if base is None:
        print("there is no tag yet: nothing to compare with")
        return 0
    try:
        git("rev-parse", "--verify", f"{base}^{{commit}}")
    except subprocess.CalledProcessError:
        parser.error(f"{base}: no commit of this repository")
    return _check.check(base, asked, options.pairs)


def measured(asked: Sequence[Row], rows: Sequence[Row]) -> int:
    """Measure and store rows, and draw the table. **Returns** 1 if some could not be measured."""
    failed = 0
    for row in asked:
        try:
            found = measure(ROOT, row.id, PAIRS)
        except Failed as failure:
            print(f"{row.id}: failed: {failure}", flush=True)
            failed = 1
            continue
        if "missing" in found:
            print(f"{row.id}: not measured: {found['missing']}", flush=True)
            continue
        _store.store(row, found)
        print(f"{row.id}: {_store.in_words(found['figures']['ours'])} {found['figures']['unit']}", flush=True)
    draw(rows)
    return failed


def draw(rows: Sequence[Row]) -> None:
    """Put the table into its page."""
    write_atomically(_store.PAGE, _store.page(rows).encode())


def last_tag() -> str | None:
    """The last tag before this commit."""
    tags = git("tag", "--merged", "HEAD", "--sort=-creatordate").split()
    return tags[0] if tags else None


if __name__ == "__main__":
    sys.exit(main())
