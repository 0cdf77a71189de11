"""Installs the tested versions of what motorgrad needs, checked by their hashes: `python tools/install.py dev,all`.

Needs nothing but Python and pip. `constraints.txt` has the versions and `hashes.txt` the SHA-256 of their files. pip
checks hashes only where all that it is asked for has one, which a checkout has not; so files are fetched first, then
checked, then installed without a network. Nothing of them runs before.
"""

import hashlib
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")
BUILD = ("editables",)  # what the build backend needs for a checkout, beside itself
INSTALLED = ("install", "--quiet", "--no-build-isolation", "-c", str(ROOT / "constraints.txt"))


def main(arguments: list[str]) -> int:
    """Install a checkout with extras, or fetch and check single packages: `--packages NAME`."""
    if arguments[:1] == ["--packages"]:
        return fetch_and_install(arguments[1:])
    checkout = [*PIP, "--isolated", *INSTALLED, "--no-index", "-e", f"{ROOT}[{','.join(arguments)}]"]
    if subprocess.run(checkout, capture_output=True, check=False).returncode == 0:  # all was there
        return 0
    extras = [extra for word in arguments for extra in word.split(",") if extra]
    status = fetch_and_install(requirements(extras))
    return status or subprocess.run(checkout, check=False).returncode


def requirements(extras: Iterable[str]) -> list[str]:
    """All that a checkout with these extras asks for, and what it is built with."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    about = project["project"]
    found = [*project["build-system"]["requires"], *BUILD, *about["dependencies"]]
    todo = [*extras]
    while todo:
        for each in about["optional-dependencies"][todo.pop()]:
            own = re.fullmatch(rf"{about['name']}\[(.*)\]", each)
            if own is None:
                found.append(each)
            else:
                todo += own[1].split(",")
    return found


def fetch_and_install(wanted: list[str]) -> int:
    """Fetch packages and all that they need, check the files, and install them. **Returns** an exit status."""
    with tempfile.TemporaryDirectory() as folder:
        # wheels only: code of other packages would run while they are fetched
        fetch = ["download", "--quiet", "--only-binary", ":all:", "--dest", folder, "-c", str(ROOT / "constraints.txt")]
        status = subprocess.run([*PIP, *fetch, *wanted], check=False).returncode
        files = sorted(Path(folder).iterdir())
        if status == 0 and all_known(files):
            install = ["install", "--quiet", "--no-index", "--no-deps"]
            return subprocess.run([*PIP, *install, *files], check=False).returncode
        return status or 1


def all_known(files: Iterable[Path]) -> bool:
    """Whether files are what hashes.txt says. Tells of those that are not, and of packages that it does not have."""
    known = hashes()
    fine = True
    for file in files:
        package, found = normal(file.name.split("-")[0]), sha256(file)
        if package not in known:
            print(f"{file.name}: hashes.txt has no such package: not checked", file=sys.stderr)
        elif found not in known[package]:
            print(f"{file.name}: SHA-256 {found} is not in hashes.txt: nothing was installed", file=sys.stderr)
            fine = False
    if not fine:
        print("If you trust where it is from, say make CHECK=no, which does not check.", file=sys.stderr)
    return fine


def hashes() -> dict[str, set[str]]:
    """The hashes of the files of each package."""
    found: dict[str, set[str]] = {}
    for pin, rest in re.findall(r"^([^=\n]+)==(.*(?:\n .*)+)", (ROOT / "hashes.txt").read_text(), re.MULTILINE):
        found.setdefault(normal(pin), set()).update(re.findall(r"--hash=sha256:([0-9a-f]{64})", rest))
    return found


def normal(name: str) -> str:
    """The name of a package, as indices compare names."""
    return re.sub(r"[-_.]+", "-", name).lower()


def sha256(file: Path) -> str:
    """The SHA-256 of a file, in hexadecimal."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
