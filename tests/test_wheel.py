"""A wheel built from the checkout installs where nothing of the checkout is, and trains there."""

import json
import os
import shutil
import site
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = [pytest.mark.slow, pytest.mark.ci]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy of what the checkout holds (without what git ignores)."""
    copy = tmp_path_factory.mktemp("checkout")
    for name in ("src", "pyproject.toml", "README.md", "LICENSE"):
        whole, target = ROOT / name, copy / name
        if whole.is_dir():
            shutil.copytree(whole, target, ignore=shutil.ignore_patterns("__pycache__", "node_modules"))
        else:
            shutil.copy(whole, target)
    shutil.copytree(ROOT / "tests", copy / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(copy / "dist")]
    done = subprocess.run(build, cwd=copy, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = (copy / "dist").glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """An environment that holds the wheel alone; its dependencies, gigabytes of them, are looked up where they are."""
    path = tmp_path_factory.mktemp("environment")
    venv.create(path, with_pip=False, symlinks=os.name != "nt")
    python = path / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    where = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(subprocess.run([python, "-c", where], capture_output=True, text=True, check=True).stdout.strip())
    assert path in packages.parents
    # The folders that a .pth file names are searched, but their own .pth files, the checkout's among them, not read.
    (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()))
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    return python


@pytest.fixture
def run(installed, process_environment, tmp_path):
    """Run something in the new environment, in an empty folder."""
    clean = {name: value for name, value in process_environment.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}

    def run(*arguments, **environment):
        done = subprocess.run(
            list(map(str, arguments)), capture_output=True, text=True, cwd=tmp_path, env=clean | environment
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_the_wheel_holds_the_package_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0].split("-")[0] for name in names} == {"motorgrad"}
    assert "motorgrad/py.typed" in names
    assert not [name for name in names if "test" in name or name.endswith((".pyc", ".toml"))]
    shipped = {name for name in names if name.startswith("motorgrad/")}
    source = ROOT / "src"
    left = ("__pycache__", "/editor/frontend/")  # what is for those who build it
    held = {path.relative_to(source).as_posix() for path in source.rglob("*") if path.is_file()}
    assert shipped == {name for name in held if not any(part in name for part in left)}
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_what_is_imported_is_what_was_installed(run, installed):
    file = Path(run(installed, "-c", "import motorgrad; print(motorgrad.__file__)").strip())
    assert installed.parents[1] in file.parents
    assert ROOT not in file.parents


def test_it_trains_a_world(run, installed, tmp_path):
    command = installed.with_name("motorgrad")
    run(command, "train", "three-state", "--steps", 2000, "--out", "run", "--json", "result.json")
    assert json.loads((tmp_path / "result.json").read_text())["decisions"] == 2000
    assert (tmp_path / "run" / "config.toml").exists()


def test_it_trains_a_body_and_films_it(run, installed, tmp_path):
    command = installed.with_name("motorgrad")
    run(command, "train", "hopper", "--steps", 100, "--seeds", 2, "--out", "run")
    run(command, "evaluate", "run", "--steps", 20, "--seconds", 0.2)
    assert (tmp_path / "run" / "figures" / "evaluation.mp4").stat().st_size > 1000


SERVES = """
import pathlib, re, socket, sys
from urllib.request import HTTPCookieProcessor, build_opener
from motorgrad.lab.editor import Server, Session

whole = socket.socket.connect
def near(self, address):
    assert address[0] == "127.0.0.1", f"the network is cut off: {address}"
    return whole(self, address)
socket.socket.connect = near

here = pathlib.Path(sys.argv[1])
session = Session(None, folder=here, states=here)
server = Server(session)
server.start()
browser = build_opener(HTTPCookieProcessor())  # the token in the address becomes a cookie
opened = browser.open(server.url)
page = opened.read().decode()
for asset in re.findall(r'(?:src|href)="\\./([^"]+)"', page):
    with browser.open(opened.url + asset) as answer:
        print(asset.rpartition(".")[2], len(answer.read()))
server.stop()
session.close()
"""


def test_it_serves_the_editor_without_node_and_without_a_network(run, installed, tmp_path):
    if not (ROOT / "src/motorgrad/lab/editor/static/index.html").exists():
        pytest.skip("the editor's pages are not built: make editor")
    served = [line.split() for line in run(installed, "-c", SERVES, tmp_path, PATH="").splitlines()]
    sizes = {kind: sum(int(size) for ending, size in served if ending == kind) for kind, _ in served}
    assert sizes["js"] > 100_000
    assert sizes["css"] > 1_000
