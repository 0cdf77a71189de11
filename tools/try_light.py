"""Try the light installation: `python -m tools.try_light`, from the root of a checkout.

Installs the library without any extra, by `pip install .` with the versions of `constraints.txt`, in a new environment
in a temporary folder. Nothing of the applications may be there, nor what they are made with. Every command that needs
no extra must work, and every other must end with one line that says how to install the extra. `--here` tries the
commands in the Python that runs this, in the working folder.
"""

import argparse
import contextlib
import io
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILES = {
    "study.toml": """
        steps = 200
        seeds = 2
        [task]
        name = ["three-state", "chain"]
    """,
    "search.toml": """
        steps = 200
        seeds = 2
        [task]
        name = "three-state"
        [agent.learning_rate]
        low = 0.01
        high = 0.1
        [search]
        trials = 2
    """,
}
"""What the commands below read."""
WORKS = (
    "--version",
    "--help",
    "list",
    "train hopper --steps 200 --seeds 2 --out hopper",
    "train particle --steps 200 --seeds 2 --out particle",
    "evaluate hopper --steps 20 --no-film",
    "plot hopper --quantity apex",
    "export hopper policy.c",
    "export hopper policy.npz",
    "sweep study.toml",
)
"""Commands that need no extra, in the order in which they run."""
NEEDS = {
    "sim hopper": "sim",
    "plot particle --animate film.gif": "sim",
    "lab": "lab",
    "export hopper policy.fmu": "lab",
    "demo": "thesis",
    "reproduce fig-2.1": "thesis",
    "evaluate hopper --steps 20 --video film.mp4": "video",
    "plot particle --animate film.mp4": "video",
    "plot hopper --tensorboard": "tensorboard",
    "train three-state --steps 200 --tensorboard --out events": "tensorboard",
    "train myoElbowPose1D6MRandom-v0 --steps 20": "myosuite",
    "export hopper policy.onnx": "onnx",
    "sweep search.toml": "search",
    "sweep study.toml --on ray": "ray",
    "sweep study.toml --on slurm": "slurm",
}
"""Commands that need an extra, after those above, and the extra."""
LEAVES_OUT = {"evaluate hopper --steps 20 --seconds 0.2": "video"}
"""Commands that work without an extra, say what they leave out, and name it."""
ABSENT = ("timsim", "timlab", "motorgrad_thesis", "viser", "starlette")
"""Modules of the applications and the thesis, and of what they are made with."""


def _run(command: str) -> tuple[int, str]:
    """Run a command of motorgrad in this process. **Returns** its exit status, and all that it printed."""
    from motorgrad.cli import main

    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            status = main(command.split())
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else 1
    return status, said.getvalue()


def faults() -> list[str]:
    """Run all commands in this process, in the working folder. **Returns** what went wrong, a line each."""
    from motorgrad._extras import install, installed

    for name, text in FILES.items():
        Path(name).write_text(text)
    found = [f"{name} is installed" for name in ABSENT if installed(name)]
    for command in WORKS:
        status, said = _run(command)
        if status != 0:
            found.append(f"motorgrad {command}: status {status}: {said.strip()}")
    for command, extra in LEAVES_OUT.items():
        status, said = _run(command)
        if status != 0 or install(extra) not in said:
            found.append(f"motorgrad {command}: must work and name {extra}, but status {status}: {said.strip()}")
    for command, extra in NEEDS.items():
        status, said = _run(command)
        lines = said.strip().splitlines()
        if status != 2 or len(lines) != 1 or not lines[0].endswith(install(extra)):
            wanted = f"must end with status 2 and one line that says how to install {extra}"
            found.append(f"motorgrad {command}: {wanted}, but status {status}: {said.strip()}")
    return found


def _attempt(folder: Path) -> None:
    """Install the library alone, and try it, in a folder."""
    own = folder / "environment" / "bin"
    started = time.monotonic()
    venv.create(folder / "environment", with_pip=True)
    install = [own / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*install, "-c", ROOT / "constraints.txt", ROOT], check=True)
    print(f"installed in {time.monotonic() - started:.0f} s", flush=True)
    empty = folder / "empty"
    empty.mkdir()
    subprocess.run([own / "motorgrad", "--help"], cwd=empty, check=True, stdout=subprocess.DEVNULL)
    # -P keeps out of the path the folder of this file, where other files have the names of packages
    subprocess.run([own / "python", "-P", Path(__file__), "--here"], cwd=empty, check=True)


def main() -> None:
    """Try the light installation; end with status 1 where a command does not do what it should."""
    parser = argparse.ArgumentParser(prog="python -m tools.try_light", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--here", action="store_true", help="try the commands in this Python and the working folder")
    if not parser.parse_args().here:
        with tempfile.TemporaryDirectory() as folder:
            _attempt(Path(folder))
        return
    found = faults()
    print(
        "\n".join(found)
        or f"{len(WORKS) + len(LEAVES_OUT)} commands work without any extra; {len(NEEDS)} name the one that they need"
    )
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
