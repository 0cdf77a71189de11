"""Coverage-guided fuzzing of the readers of strangers' files (atheris): `python -m tools.fuzz READER --seconds 3600`.

An input is found that makes a reader raise anything but a refusal, do anything but read (tests/audit.py), hang, or
crash. The readers are those of tests/reader_examples.py. Needs atheris, which no extra installs.
"""

import argparse
import contextlib
import importlib
import io
import os
import random
import re
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
MAX_SECONDS = 20  # s of one input
WARM_UP = 500  # inputs before what happens is watched: what is imported when first used is so then
MAX_MEGABYTES = 6000  # resident; JAX and MuJoCo take a good part
ARCHIVE = b"PK\x03\x04"
MEMBER = b"\n#####"  # between the members of an archive that is laid open


def main() -> None:
    """Fuzz one reader for so many seconds, from a good file of its kind and what earlier runs have found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("reader")
    parser.add_argument("--seconds", type=int, default=3600, help="processor time")
    parser.add_argument("--corpus", type=Path, default=ROOT / "build" / "fuzz")
    given = parser.parse_args()

    atheris: Any = importlib.import_module("atheris")
    sys.path.insert(0, str(ROOT / "tests"))
    with atheris.instrument_imports(include=["motorgrad"]):
        import reader_examples  # type: ignore[import-not-found]
    import audit  # type: ignore[import-not-found]

    reader = reader_examples.READERS[given.reader]
    corpus = (given.corpus / given.reader.replace(" ", "-")).absolute()
    corpus.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    os.chdir(folder)
    reader_examples.written("m.xml", reader_examples.MODEL)(folder)
    warnings.simplefilter("ignore")
    sink = open(os.devnull, "w")  # noqa: SIM115 - what commands say is nobody's; as long as the process
    file = reader.make(folder)
    reader.read(file)
    content = laid_open(file.read_bytes())
    (corpus / "good").write_bytes(content)
    words = corpus.with_name(f"{corpus.name}.words")
    words.write_text(dictionary(content))

    def write(data: bytes) -> None:
        file.write_bytes(closed(data))
        reader.finish(file)

    def read() -> None:
        streams = sys.stdout, sys.stderr
        sys.stdout = sys.stderr = sink
        try:
            with contextlib.suppress(*reader_examples.REFUSALS):
                reader.read(file)
        finally:
            sys.stdout, sys.stderr = streams

    count = 0
    findings: set[str] = set()

    def one(data: bytes) -> None:
        nonlocal count
        count += 1
        write(data)
        try:
            with audit.nothing_happens():
                read()
        except BaseException as error:  # goes on, so that one finding hides no other
            place = traceback.extract_tb(error.__traceback__)[-1]
            finding = f"{type(error).__name__} at {place.filename}:{place.lineno}: {str(error)[:200]}"
            kind = finding.split(": ")[0] if not isinstance(error, AssertionError) else str(error)[:60]
            if kind not in findings:
                findings.add(kind)
                corpus.with_name(f"{corpus.name}-found-{len(findings)}").write_bytes(data)
                print(f"finding {len(findings)}: {finding}", flush=True)
        if time.process_time() > given.seconds:
            seconds = f"{time.process_time():.0f} s of processor time"
            print(f"{given.reader}: {count:,} inputs in {seconds}, {len(findings)} findings", flush=True)
            os._exit(bool(findings))  # libFuzzer's own end takes a wall time

    for changed in (b"", *audit.mutations(content, WARM_UP, random.Random(0))):
        write(changed)
        with contextlib.suppress(Exception):  # is found again, and told, when it is watched
            read()

    found = corpus.with_name(f"{corpus.name}-crash-")
    limits = [f"-timeout={MAX_SECONDS}", f"-rss_limit_mb={MAX_MEGABYTES}", f"-dict={words}"]
    size = f"-max_len={max(4096, 4 * len(content))}"
    atheris.Setup(["fuzz", str(corpus), *limits, size, f"-artifact_prefix={found}"], one)
    atheris.Fuzz()


def laid_open(content: bytes) -> bytes:
    """A file with its archive unpacked, as checksums and packing would keep a fuzzer from what is in it."""
    start = content.find(ARCHIVE)
    if start < 0:
        return content
    with zipfile.ZipFile(io.BytesIO(content[start:])) as file:
        members = [MEMBER + name.encode() + b"\n" + file.read(name) for name in file.namelist()]
    return content[:start] + b"".join(members)


def closed(content: bytes) -> bytes:
    """The inverse of `laid_open`, for whatever has become of it."""
    head, *members = content.split(MEMBER)
    if not members:
        return content
    packed = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(packed, "w") as file:
        warnings.simplefilter("ignore")  # two members of one name are an attack, too
        for member in members:
            name, _, data = member.partition(b"\n")
            file.writestr(name.decode("latin-1").replace("\0", "") or "x", data)
    return head + packed.getvalue()


def dictionary(content: bytes) -> str:
    """The words of a file in libFuzzer's form, from which it puts inputs together."""
    words = dict.fromkeys(re.findall(rb"[A-Za-z_][\w.\-]{2,40}|\d[\d.e+-]*", content))
    lines = ("".join(f"\\x{byte:02x}" for byte in word) for word in list(words)[:500])
    return "".join(f'"{line}"\n' for line in lines)


if __name__ == "__main__":
    main()
