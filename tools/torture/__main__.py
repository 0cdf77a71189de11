"""Attack the library and the applications, and count: `python -m tools.torture`, from the root of a checkout.

Each test of `TESTS` is repeated `--count` times; the soak lasts for so many minutes. With `--record FILE`, the counts
are added to those of earlier sessions with the same version of motorgrad, so that a thousand kills can be spread over a
week. `--table` prints the record as the table of docs/reliability.md. The exit status is 1 if anything failed; the
files of what failed are kept.
"""

import argparse
import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import motorgrad as mg
from motorgrad._files import write_atomically
from tools.torture import _applications, _damage, _mutations, _soak, _training
from tools.torture._training import Failure, say

TESTS = {
    **{f"kill {name}": (_training.torture, name) for name in _training.ENGINES},
    **{f"kill {name}": (attack, name) for name, attack in _applications.ATTACKS.items()},
    **{f"damage {name}": (attack, name) for name, attack in _damage.ATTACKS.items()},
    **{f"mutate {name}": (attack, name) for name, attack in _mutations.ATTACKS.items()},
    **{f"soak {name}": (attack, name) for name, attack in _soak.ATTACKS.items()},
}
"""Every test by name: a function of a name, a folder, a count and a random generator, which returns the outcomes
counted by kind and the number of comparisons, and raises `Failure`."""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tests", nargs="*", metavar="TEST", help=f"by default all: {', '.join(TESTS)}")
    parser.add_argument("--count", type=int, default=10, help="repetitions of each test (10)")
    parser.add_argument(
        "--seed", type=int, default=0, help="of the random numbers (0); with --record, of the first session"
    )
    parser.add_argument("--record", type=Path, help="a JSON file in which sessions add up")
    parser.add_argument("--table", action="store_true", help="only print the record as a table")
    options = parser.parse_args(arguments)
    if options.count < 1 or options.seed < 0:
        parser.error("--count must be at least 1 and --seed at least 0")
    if unknown := [name for name in options.tests if not any(test.startswith(name) for test in TESTS)]:
        parser.error(f"{unknown[0]!r} is none of {', '.join(TESTS)}")
    record = Record(options.record)
    if options.table:
        print(record.table())
        return 0
    chosen = [test for test in TESTS if not options.tests or test.startswith(tuple(options.tests))]
    return max(attack(test, options.count, options.seed, record) for test in chosen)


def attack(test: str, count: int, seed: int, record: "Record") -> int:
    """Run one test, and record it. **Returns** 1 if it failed, else 0."""
    run, name = TESTS[test]
    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    start = time.monotonic()
    # each session draws new numbers
    random = np.random.default_rng([seed, list(TESTS).index(test), record.sessions(test)])
    try:
        outcomes, compared = run(name, folder, count, random)
    except Failure as failure:
        say(f"{test}: FAILED: {failure}\nThe files are in {folder}.")
        record.add(test, {}, failed=1)
        return 1
    shutil.rmtree(folder)
    record.add(test, dict(outcomes))
    counts = ", ".join(f"{number} {kind}" for kind, number in outcomes.items())
    say(f"{test}: {counts}; {compared} compared; {time.monotonic() - start:.0f} s")
    return 0


class Record:
    """The counts of all sessions, in a file or only in memory. Counts of another version of motorgrad are discarded."""

    def __init__(self, path: Path | None):
        self._path = path
        stored = json.loads(path.read_text()) if path is not None and path.exists() else {}
        self._tests = stored["tests"] if stored.get("version") == mg.__version__ else {}

    def sessions(self, test: str) -> int:
        """The number of recorded sessions of a test."""
        return self._tests.get(test, {}).get("sessions", 0)

    def add(self, test: str, outcomes: dict[str, int], failed: int = 0) -> None:
        """Add a session of a test."""
        entry = self._tests.setdefault(test, {"sessions": 0, "failed": 0, "outcomes": {}})
        entry["sessions"] += 1
        entry["failed"] += failed
        for kind, number in outcomes.items():
            entry["outcomes"][kind] = entry["outcomes"].get(kind, 0) + number
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps({"version": mg.__version__, "tests": self._tests}, indent=2)
            write_atomically(self._path, f"{text}\n".encode())

    def table(self) -> str:
        """The counts as a Markdown table."""
        lines = ["| test | tried | outcomes | fell |", "|---|---|---|---|"]
        for test, entry in self._tests.items():
            outcomes = ", ".join(f"{number:,} {kind}" for kind, number in sorted(entry["outcomes"].items()))
            lines.append(f"| {test} | {sum(entry['outcomes'].values()):,} | {outcomes} | {entry['failed']} |")
        return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
