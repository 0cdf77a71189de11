"""Installs a checkout with extras, and the tested versions of what they need: `python tools/install.py dev,all`.

The checkout's packages that the extras reach are installed editable: the library, and TimSim, TimLab and the thesis.
Needs nothing but Python and pip. `constraints.txt` has the versions and `hashes.txt` the SHA-256 of their files. pip
checks hashes only where all that it is asked for has one, which a checkout has not; so files are fetched first, then
checked, then installed without a network. Nothing of them runs before. `--unchecked` leaves all of that to pip.
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
PACKAGES = (".", "apps/timsim", "apps/timlab", "thesis")
"""The folders of the checkout's packages, the library's first."""
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")
BUILD = ("editables",)  # what the build backend needs for a checkout, beside itself
INSTALL = ("install", "--quiet", "-c", str(ROOT / "constraints.txt"))


def main(arguments: list[str]) -> int:
    """Install a checkout with extras, `--unchecked` as pip does; or fetch and check single packages: `--packages NAME`.
    **Returns** an exit status."""
    if arguments[:1] == ["--packages"]:
        return fetch_and_install(arguments[1:])
    unchecked = arguments[:1] == ["--unchecked"]
    extras = [extra for word in arguments[unchecked:] for extra in word.split(",") if extra]
    wanted, folders = requirements(extras)
    checkout: list[str] = []
    for folder in folders:
        checkout += ["-e", f"{folder}[{','.join(extras)}]" if folder == ROOT and extras else str(folder)]
    if unchecked:
        return subprocess.run([*PIP, *INSTALL, *checkout], check=False).returncode
    alone = [*PIP, "--isolated", *INSTALL, "--no-build-isolation", "--no-index", *checkout]
    if subprocess.run(alone, capture_output=True, check=False).returncode == 0:  # all was there
        return 0
    status = fetch_and_install(wanted)
    return status or subprocess.run(alone, check=False).returncode


def requirements(extras: Iterable[str]) -> tuple[list[str], list[Path]]:
    """All that a checkout with these extras asks for, with what it is built with; and the folders of the packages of
    the checkout that are among it, the library's first."""
    projects = {
        tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"]["name"]: ROOT / folder
        for folder in PACKAGES
    }
    found = [*BUILD]
    folders: list[Path] = []
    todo = [(next(iter(projects)), tuple(extras))]
    while todo:
        name, chosen = todo.pop()
        project = tomllib.loads((projects[name] / "pyproject.toml").read_text())
        asked = [each for extra in chosen for each in project["project"]["optional-dependencies"][extra]]
        if projects[name] not in folders:
            folders.append(projects[name])
            asked += [*project["build-system"]["requires"], *project["project"]["dependencies"]]
        for each in asked:
            own = re.fullmatch(r"([A-Za-z-]+)(?:\[(.*)\])?(?:==.*)?", each)
            if own is None or own[1] not in projects:
                found.append(each)
            elif own[2] or projects[own[1]] not in folders:
                todo.append((own[1], tuple((own[2] or "").split(",")) if own[2] else ()))
    return found, folders


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
        package = normal(file.name.split("-")[0])
        found = sha256(file)
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
