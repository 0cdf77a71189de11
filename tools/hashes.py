"""Writes `hashes.txt`: the SHA-256 of the files of the versions in `constraints.txt`, from the index that pip uses.

`python -m tools.hashes` after a change of `constraints.txt`. Wheels of CPython from 3.11 on for Linux (x86-64, ARM),
macOS and Windows are listed. A wheel on this machine that is built otherwise, such as torch without CUDA, is given as
a file: `python -m tools.hashes FILE`.
"""

import json
import re
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from pip._internal.models.index import PyPI

from tools.install import ROOT, normal, sha256

HEAD = """\
# The SHA-256 of the files of the versions in constraints.txt, which `make` checks before it installs them
# (tools/install.py). `python -m tools.hashes` writes it.
"""
OTHERS = re.compile(r"musllinux|i686|ppc64|s390|armv|win32|riscv|ios|android|emscripten|pyodide|loongarch")
OLD = re.compile(r"-(?:pp3\d+|cp3[5-9]|cp310|py2)-")  # interpreters; wheels of the stable ABI name the oldest
FORM = "application/vnd.pypi.simple.v1+json"


def main(files: list[str]) -> None:
    """Write the hashes of all versions, and of wheels that the index does not have."""
    versions = pins()
    own: dict[str, list[str]] = {}
    for file in map(Path, files):
        name, version = file.name.split("-")[:2]
        own.setdefault(f"{normal(name)}=={version.partition('+')[0]}", []).append(sha256(file))
    with ThreadPoolExecutor(8) as pool:
        found = pool.map(lambda pin: [*hashes_of(*pin.split("=="))], versions)
    lines = [HEAD]
    for pin, hashes in zip(versions, found, strict=True):
        every = sorted({*hashes, *own.get(pin, [])})
        if not every:
            raise SystemExit(f"{pin}: the index has no wheel")
        lines.append(" \\\n    ".join([pin, *(f"--hash=sha256:{each}" for each in every)]) + "\n")
    (ROOT / "hashes.txt").write_text("".join(lines))


def pins() -> list[str]:
    """The versions of constraints.txt, as NAME==VERSION."""
    lines = (re.split("[#;]", line)[0].strip() for line in (ROOT / "constraints.txt").read_text().splitlines())
    return sorted({line for line in lines if line})


def hashes_of(name: str, version: str) -> Iterator[str]:
    """The hashes of the wheels of a version."""
    request = urllib.request.Request(f"{index()}/{name}/", headers={"Accept": FORM})
    with urllib.request.urlopen(request, timeout=60) as answer:
        files = json.load(answer)["files"]
    for file in files:
        parts = file["filename"].removesuffix(".whl").split("-")
        right = file["filename"].endswith(".whl") and normal(parts[0]) == normal(name) and parts[1] == version
        stable = right and "abi3" in parts[-2]
        if right and not OTHERS.search(parts[-1]) and (stable or not OLD.search(f"-{parts[-3]}-")):
            yield file["hashes"]["sha256"]


def index() -> str:
    """The address of the package index that pip is told to use."""
    asked = [sys.executable, "-m", "pip", "config", "get", "global.index-url"]
    answer = subprocess.run(asked, capture_output=True, text=True, check=False)
    return answer.stdout.strip().rstrip("/") or PyPI.simple_url.rstrip("/")


if __name__ == "__main__":
    main(sys.argv[1:])
