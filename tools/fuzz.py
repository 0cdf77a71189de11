"""Coverage-guided fuzzing of the readers of strangers' files (atheris): `python -m tools.fuzz READER --seconds 3600`.

An input is found that makes a reader raise anything but a refusal, do anything but read (tests/audit.py), or hang. The
readers are those of tests/test_readers.py. Needs atheris, which no extra installs.
"""

import argparse
import contextlib
import os
import random
import sys
import tempfile
import warnings
from pathlib import Path

ROOT = Path(__file__).parents[1]
MAX_SECONDS = 20  # s of one input
WARM_UP = 500  # inputs before what happens is watched: what is imported when first used is so then
MAX_MEGABYTES = 6000  # resident; JAX and MuJoCo take a good part


def main() -> None:
    """Fuzz one reader for so many seconds, from a good file of its kind and what earlier runs have found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("reader")
    parser.add_argument("--seconds", type=int, default=3600)
    parser.add_argument("--corpus", type=Path, default=ROOT / "build" / "fuzz")
    given = parser.parse_args()

    import atheris

    sys.path.insert(0, str(ROOT / "tests"))
    with atheris.instrument_imports(include=["motorgrad"]):
        import test_readers
    import audit

    reader = test_readers.READERS[given.reader]
    corpus = given.corpus / given.reader.replace(" ", "-")
    corpus.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    os.chdir(folder)
    test_readers.written("m.xml", test_readers.MODEL)(folder)
    warnings.simplefilter("ignore")
    sink = open(os.devnull, "w")  # noqa: SIM115 - what commands say is nobody's; as long as the process
    file = reader.make(folder)
    reader.read(file)
    content = file.read_bytes()
    (corpus / "good").write_bytes(content)

    def write(data: bytes) -> None:
        file.write_bytes(data)
        if file.suffix == ".state":
            test_readers.with_right_checksum(file)

    def read() -> None:
        told = sys.stdout, sys.stderr
        sys.stdout = sys.stderr = sink
        with contextlib.suppress(*test_readers.REFUSALS):
            reader.read(file)
        sys.stdout, sys.stderr = told

    def one(data: bytes) -> None:
        write(data)
        with audit.nothing_happens():
            read()

    for changed in (b"", *audit.mutations(content, WARM_UP, random.Random(0))):
        write(changed)
        read()

    found = corpus.with_name(f"{corpus.name}-found-")
    limits = [f"-max_total_time={given.seconds}", f"-timeout={MAX_SECONDS}", f"-rss_limit_mb={MAX_MEGABYTES}"]
    size = f"-max_len={max(4096, 4 * len(content))}"
    atheris.Setup(["fuzz", str(corpus.absolute()), *limits, size, f"-artifact_prefix={found.absolute()}"], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
