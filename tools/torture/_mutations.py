"""Mutated inputs: the suite's own tests of mutations, at their largest counts."""

import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from tools.torture._training import Failure

TESTS = {
    "settings": "tests/cli/test_cli_mutations.py::test_a_spoilt_file_gives_an_answer_or_is_refused_on_one_line[10000]",
    "diagrams": "apps/timlab/tests/test_lab_spoilt_files.py::"
    "test_a_spoilt_file_is_loaded_or_refused_on_one_line_and_runs_no_code[10000]",
}
COUNT = 10_000


def mutate(name: str, folder: Path, count: int, random: np.random.Generator) -> tuple[Counter[str], int]:
    """Load ten thousand mutated inputs, always the same ones, whatever the `count`."""
    del folder, count, random
    command = [sys.executable, "-m", "pytest", "-q", "-m", "slow", "-p", "no:xdist", TESTS[name]]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise Failure(done.stdout + done.stderr)
    return Counter({"answered or refused": COUNT}), 0


ATTACKS = dict.fromkeys(TESTS, mutate)
