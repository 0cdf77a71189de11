"""Try a release: `python -m tools.try_release [PYTHON …]`, from the root of a checkout.

Builds the source distributions and the wheels of all four packages, and installs both in a new environment of each
Python, by default the oldest and the newest that `pyproject.toml` names, with the versions of `constraints.txt`. There
it runs commands, the code of the README and a share of the quick tests, those of the source distributions, against what
was installed.

A Python is looked for on the path and among those of pyenv. One that is missing comes from Debian where debootstrap and
the rights of root are at hand: `build/release/python-VERSION` then holds a small Debian, which later calls use again.
"""

import argparse
import dataclasses
import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path

from tools.install import PACKAGES

ROOT = Path(__file__).parents[1]
SUITES = {"3.11": "bookworm", "3.13": "trixie", "3.14": "sid"}
"""Debian's suites, and the Python of each."""
CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")
EXTRAS = "dev,all,onnx"
TESTS = (
    "tests/test_docs.py::test_the_code_runs_and_prints_what_the_page_says[README.md]",
    "tests/test_import.py",
    "tests/test_playback.py",
    "tests/cli/test_cli_messages.py",
    "tests/learning/test_learning_parts.py",
    "tests/policies/test_policy_structure.py",
    "tests/training/test_training_checkpoints.py",
    "apps/timsim/tests/test_sim_viewpoint.py",
    "apps/timlab/tests/test_lab_engine_timeline.py",
    "thesis/tests/test_score.py",
)
COMMANDS = (
    "--version",
    "--help",
    "list",
    "train hopper --steps 200 --seeds 2 --out run",
    "evaluate run --steps 20 --seconds 0.2",
    "export run policy.onnx",
    "train three-state --steps 2000 --out world",
    "reproduce fig-2.1 --quick --out reproduced",
    "sim --help",
    "lab --help",
)


@dataclasses.dataclass(frozen=True)
class Interpreter:
    """A Python, and the folder that it sees as the root of all files: that of a small Debian, or none."""

    python: str
    root: Path | None = None

    def __call__(self, *command: str | Path, cwd: Path) -> None:
        """Run a command in a folder.

        **Raises** `subprocess.CalledProcessError` if it fails.
        """
        words = [self.name(word) for word in command]
        quiet = {"MPLBACKEND": "agg", "PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_QUIET": "1"}
        if self.root is None:
            kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
            subprocess.run(words, cwd=cwd, env=kept | quiet, check=True)
            return
        settings = {"HOME": "/root", "LANG": "C.UTF-8", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}
        settings |= {"PIP_CERT": str(CERTIFICATES)} if CERTIFICATES.exists() else {}
        settings |= {name: value for name, value in os.environ.items() if name.lower().endswith("_proxy")}
        enter = [
            "unshare",
            "--mount",
            "sh",
            "-c",
            'mount -t proc proc "$0/proc" && exec chroot "$0" "$@"',
        ]  # XLA reads it
        there = ["sh", "-c", 'cd "$0" && exec "$@"', self.name(cwd)]
        subprocess.run([*enter, str(self.root), *there, *words], env=settings | quiet, check=True)

    def name(self, path: str | Path) -> str:
        """A path as the interpreter sees it."""
        if self.root is not None and isinstance(path, Path) and path.is_relative_to(self.root):
            return f"/{path.relative_to(self.root)}"
        return str(path)


def named() -> list[str]:
    """The versions of Python that the package names, from the oldest to the newest."""
    classifiers = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["classifiers"]
    return [found[1] for line in classifiers if (found := re.search(r":: (3\.\d+)$", line))]


def at_hand(version: str) -> Interpreter | None:
    """A Python of this version, on the path or of pyenv; `None` without one."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"), "versions")
    for python in (shutil.which(f"python{version}"), *sorted(map(str, pyenv.glob(f"{version}.*/bin/python")))):
        tell = [python or "", "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
        if python and subprocess.run(tell, capture_output=True, text=True).stdout.strip() == version:
            return Interpreter(python)
    return None


def from_debian(version: str, root: Path) -> Interpreter:
    """A Python of this version in a small Debian in the folder `root`, which is made if need be."""
    python = root / "usr" / "bin" / f"python{version}"
    if not (root / "made").exists():
        if version not in SUITES or not shutil.which("debootstrap") or os.geteuid():
            sys.exit(f"no Python {version} is at hand; debootstrap and the rights of root would fetch one from Debian")
        shutil.rmtree(root, ignore_errors=True)
        tell = ["apt-get", "indextargets", "--format", "$(ORIGIN) $(LABEL) $(REPO_URI)", "Created-By: Packages"]
        listed = subprocess.run(tell, capture_output=True, text=True, check=True).stdout  # the mirror of this machine
        mirrors = [line.split()[2] for line in listed.splitlines() if line.startswith("Debian Debian ")]
        if not mirrors:
            sys.exit("apt-get knows no mirror of Debian: apt-get update")
        make = ["debootstrap", "--variant=minbase", "--include=python3-venv,ca-certificates", SUITES[version]]
        subprocess.run(["unshare", "--mount", *make, str(root), mirrors[0]], check=True)
        if not python.exists():
            sys.exit(f"Debian's {SUITES[version]} has another Python than {version}")
        for file in filter(Path.exists, (CERTIFICATES, Path("/etc/resolv.conf"))):  # to reach what pip reaches here
            shutil.copy(file, root / file.relative_to("/"))
        (root / "made").touch()
    return Interpreter(f"/usr/bin/python{version}", root)


def build(place: Path, checkout: Path = ROOT, *options: str) -> dict[str, tuple[Path, Path]]:
    """Build the source distribution of each package, and the wheel from it. **Returns** both, by the package's folder
    in the checkout. `options` are of `python -m build`."""
    shutil.rmtree(place, ignore_errors=True)
    made = {}
    for folder in PACKAGES:
        command = [sys.executable, "-m", "build", *options, "--outdir", place, checkout / folder]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        project = tomllib.loads((checkout / folder / "pyproject.toml").read_text())["project"]
        name = f"{project['name'].replace('-', '_')}-{project['version']}"
        made[folder] = (place / f"{name}.tar.gz", place / f"{name}-py3-none-any.whl")
    return made


def unpack(sources: Mapping[str, Path], place: Path) -> None:
    """Make a checkout in the folder `place` of the source distributions, which are given by their folders in it."""
    for folder, source in sources.items():
        (place / folder).mkdir(parents=True, exist_ok=True)
        with tarfile.open(source) as archive:
            for member in archive:
                inner = member.name.partition("/")[2]
                archive.extract(member.replace(name=inner), place / folder, filter="data")


def attempt(python: Interpreter, built: Mapping[str, tuple[Path, Path]], folder: Path) -> None:
    """Install the source distributions, then the wheels, in a new environment in `folder`, and use what is installed.

    **Raises** `subprocess.CalledProcessError` if anything fails.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)

    def here(files: Iterable[Path]) -> list[Path]:
        return [Path(shutil.copy(file, folder)) for file in files]

    sources = here(source for source, _ in built.values())
    wheels = here(wheel for _, wheel in built.values())
    own = folder / "environment" / "bin"
    install = [own / "python", "-m", "pip", "install", "-c", *here([ROOT / "constraints.txt"])]

    def step(what: str, *command: str | Path, cwd: Path = folder) -> None:
        started = time.monotonic()
        python(*command, cwd=cwd)
        print(f"  {what}: {time.monotonic() - started:.0f} s", flush=True)

    step("environment", python.python, "-m", "venv", folder / "environment")
    step("source distributions", *install, f"{python.name(sources[0])}[{EXTRAS}]", *sources[1:])
    step("wheels", *install, "--force-reinstall", "--no-deps", *wheels)
    for command in COMMANDS:
        step(f"motorgrad {command}", own / "motorgrad", *command.split())
    checkout = folder / "checkout"
    unpack(dict(zip(built, sources, strict=True)), checkout)
    for package in PACKAGES:
        shutil.rmtree(checkout / package / "src")  # what is tested is what was installed
    step("tests", own / "python", "-m", "pytest", "-q", "-m", "not slow", *TESTS, cwd=checkout)
    shutil.rmtree(folder)  # gigabytes


def main() -> None:
    """Build the release, and try it with every Python."""
    parser = argparse.ArgumentParser(prog="python -m tools.try_release", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "versions", nargs="*", metavar="VERSION", help="a version; by default the oldest and the newest"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "release", help="the folder for what is built")
    options = parser.parse_args()
    out = options.out.absolute()
    built = build(out / "dist")
    print(f"built in {out / 'dist'}: {', '.join(file.name for files in built.values() for file in files)}", flush=True)
    for version in options.versions or (named()[0], named()[-1]):
        print(f"Python {version}", flush=True)
        python = at_hand(version) or from_debian(version, out / f"python-{version}")
        attempt(python, built, (python.root or out) / "try")
    print("the release can be installed and works")


if __name__ == "__main__":
    main()
