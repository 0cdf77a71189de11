"""A source distribution, and a wheel built from it that installs and trains where nothing of the checkout is."""

import importlib.metadata
import json
import os
import shutil
import site
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tools.try_release import TESTS, at_hand, named

ROOT = Path(__file__).parents[1]

pytestmark = [pytest.mark.slow, pytest.mark.ci]


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder with the source distribution and the wheel built from it, as a release makes them."""
    copy = tmp_path_factory.mktemp("checkout")
    for name in (".gitignore", "pyproject.toml", *PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]):
        whole, target = ROOT / name, copy / name
        if whole.is_dir():
            shutil.copytree(whole, target, ignore=shutil.ignore_patterns("__pycache__", "node_modules"))
        elif whole.exists():
            shutil.copy(whole, target)
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(copy / "dist")]
    done = subprocess.run(build, cwd=copy, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return copy / "dist"


@pytest.fixture(scope="module")
def wheel(built):
    (built,) = built.glob("*.whl")
    return built


def environment(path, wheel, dependencies):
    """A new environment that holds the wheel. `dependencies` puts into its folder of packages what the wheel needs."""
    venv.create(path, with_pip=False, symlinks=os.name != "nt")
    python = path / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    where = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(subprocess.run([python, "-c", where], capture_output=True, text=True, check=True).stdout.strip())
    assert path in packages.parents
    dependencies(packages)
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    return python


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """An environment that holds the wheel alone; its dependencies, gigabytes of them, are looked up where they are."""

    def everything(packages):
        # Folders named by a .pth file are searched, but their own .pth files, the checkout's among them, are not read.
        (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()))

    return environment(tmp_path_factory.mktemp("environment"), wheel, everything)


@pytest.fixture(scope="module")
def light(wheel, tmp_path_factory):
    """An environment with the wheel and links to what it requires without any extra, and to nothing else."""

    def required(packages):
        for name in closure(PROJECT["project"]["dependencies"]):
            distribution = importlib.metadata.distribution(name)
            for top in {Path(file).parts[0] for file in distribution.files or ()} - {"..", "__pycache__"}:
                link = packages / top
                if not link.exists():
                    link.symlink_to(Path(str(distribution.locate_file(top))).resolve())

    return environment(tmp_path_factory.mktemp("light"), wheel, required)


def closure(requirements):
    """The names of all packages that `requirements` ask for here, directly or not."""
    names, left = set(), [(Requirement(text), "") for text in requirements]
    while left:
        requirement, extra = left.pop()
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": extra}):
            continue
        for each in ("", *requirement.extras):
            if (requirement.name, each) not in names:
                names.add((requirement.name, each))
                left += [(Requirement(text), each) for text in importlib.metadata.requires(requirement.name) or ()]
    return {name for name, _ in names}


@pytest.fixture
def run(process_environment, tmp_path):
    """Run something in an empty folder, with nothing of the checkout in its environment."""
    clean = {name: value for name, value in process_environment.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}

    def run(*arguments, **environment):
        done = subprocess.run(
            list(map(str, arguments)), capture_output=True, text=True, cwd=tmp_path, env=clean | environment
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_the_source_distribution_holds_what_builds_and_tests_it(built):
    (source,) = built.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md", "Makefile"} <= names
    assert {"src/motorgrad/__init__.py", "tests/test_wheel.py", "tools/build_editor.py", "docs/index.md"} <= names
    assert not [name for name in names if name.endswith(".pyc") or "node_modules" in name]


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


def test_without_extras_commands_work_or_name_the_one_that_they_need(run, light):
    # -P keeps the folder of the script out of the path
    run(light, "-P", ROOT / "tools" / "try_light.py", "--here")


ROOMS = """
import motorgrad as mg
mg.search, mg.studies, mg.experiments, mg.environments, mg.export
try:
    mg.lab
except RuntimeError as error:
    print(error)
"""


def test_without_extras_a_room_can_be_used_or_names_the_one_that_it_needs(run, light):
    assert run(light, "-c", ROOMS) == "TimLab needs the package diffrax: pip install '.[lab]'\n"


def test_the_source_distribution_installs_what_the_wheel_does(built, wheel, installed, tmp_path):
    (source,) = built.glob("*.tar.gz")
    pip = [sys.executable, "-m", "pip", "--python", str(installed)]
    folder = tmp_path / "from source"
    # what builds it is looked up among the dependencies of `installed`, as no network is needed here
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--target", str(folder)]
    subprocess.run([*pip, "install", *options, str(source)], check=True, capture_output=True)
    held = {name for name in zipfile.ZipFile(wheel).namelist() if name.startswith("motorgrad/")}
    package = [path for path in (folder / "motorgrad").rglob("*") if path.is_file() and path.suffix != ".pyc"]
    assert {path.relative_to(folder).as_posix() for path in package} == held


def test_a_release_is_tried_on_the_oldest_and_the_newest_python():
    # `make release` does it, as most machines have one Python
    assert PROJECT["project"]["requires-python"] == f">={named()[0]}"
    python = at_hand(f"{sys.version_info.major}.{sys.version_info.minor}")
    assert python is not None
    assert python.root is None
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = {canonicalize_name(Requirement(line).name) for line in lines if not line.startswith("#")}
    assert {canonicalize_name(name) for name in closure(PROJECT["project"]["dependencies"])} <= pinned
    for name in TESTS:
        assert (ROOT / name.partition("::")[0]).exists(), name


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
