"""Source distributions of all packages, and wheels built from them that install and train where no checkout is."""

import importlib.metadata
import json
import os
import shutil
import site
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from motorgrad._extras import install
from motorgrad.commands import EXTRA_OF_COMMAND
from tools.install import PACKAGES, ROOT
from tools.try_release import TESTS, at_hand, build, named, unpack

pytestmark = [pytest.mark.slow, pytest.mark.ci]


def project(folder):
    """What the pyproject.toml of a package says of the package, and what of its build."""
    whole = tomllib.loads((ROOT / folder / "pyproject.toml").read_text())
    return whole["project"], whole["tool"]["hatch"]["build"]["targets"]


MODULES = {folder: project(folder)[1]["wheel"]["packages"][0] for folder in PACKAGES}
"""The folder of each package's module in that of the package."""
OWN_PATH = ("PYTHONPATH", "VIRTUAL_ENV")
"""Variables that would let a process find what is not in its environment."""
PAGES = "apps/timlab/src/timlab/editor/static/index.html"


def files_in(folder):
    """The paths of all files in a folder, seen from it."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of what the source distributions are made of, with things in it that they should not have."""
    copy = tmp_path_factory.mktemp("checkout")
    shutil.copy(ROOT / ".gitignore", copy)
    for folder in PACKAGES:
        (copy / folder).mkdir(parents=True, exist_ok=True)
        for name in ("/pyproject.toml", *project(folder)[1]["sdist"]["include"]):
            whole = ROOT / folder / name[1:]
            target = copy / folder / name[1:]
            if whole.is_dir():
                shutil.copytree(whole, target, ignore=shutil.ignore_patterns("__pycache__", "node_modules"))
            else:
                shutil.copy(whole, target)
    return copy


@pytest.fixture(scope="module")
def built(checkout, tmp_path_factory):
    """The source distribution of each package and the wheel built from it, as a release makes them, by its folder."""
    for left in ("apps/timlab/src/timlab/editor/frontend/node_modules/left/index.js", "dist/left", "runs/left"):
        (checkout / left).parent.mkdir(parents=True)
        (checkout / left).touch()
    return build(tmp_path_factory.mktemp("dist"), checkout, "--no-isolation")


@pytest.fixture(scope="module")
def wheels(built):
    return {folder: wheel for folder, (_, wheel) in built.items()}


def environment(path, wheels, dependencies):
    """A new environment that holds wheels. `dependencies` puts into its folder of packages what these need."""
    venv.create(path, with_pip=False, symlinks=os.name != "nt")
    python = path / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    where = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(subprocess.run([python, "-c", where], capture_output=True, text=True, check=True).stdout.strip())
    assert path in packages.parents
    dependencies(packages)
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", *wheels]
    clean = {name: value for name, value in os.environ.items() if name not in OWN_PATH}
    subprocess.run(install, check=True, capture_output=True, env=clean)
    return python


@pytest.fixture(scope="module")
def installed(wheels, tmp_path_factory):
    """An environment that holds all wheels; their dependencies, gigabytes of them, are looked up where they are."""

    def everything(packages):
        # Folders named by a .pth file are searched, but their own .pth files, the checkout's among them, are not read.
        (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()))

    return environment(tmp_path_factory.mktemp("environment"), wheels.values(), everything)


@pytest.fixture(scope="module")
def light(wheels, tmp_path_factory):
    """An environment with the library's wheel and links to what it requires without any extra, and to nothing else."""

    def required(packages):
        for name in closure(project(".")[0]["dependencies"]):
            distribution = importlib.metadata.distribution(name)
            for top in {Path(file).parts[0] for file in distribution.files or ()} - {"..", "__pycache__"}:
                link = packages / top
                if not link.exists():
                    link.symlink_to(Path(str(distribution.locate_file(top))).resolve())

    return environment(tmp_path_factory.mktemp("light"), [wheels["."]], required)


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
    clean = {name: value for name, value in process_environment.items() if name not in OWN_PATH}

    def run(*arguments, **environment):
        done = subprocess.run(
            list(map(str, arguments)), capture_output=True, text=True, cwd=tmp_path, env=clean | environment
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_the_source_distributions_hold_what_builds_and_tests_them_and_nothing_else(built, checkout, tmp_path):
    unpack({folder: source for folder, (source, _) in built.items()}, tmp_path)
    own = {Path(folder, name).as_posix() for folder in PACKAGES for name in (".gitignore", "PKG-INFO")}
    left = {name for name in files_in(checkout) if Path(name).name == "left" or "node_modules" in name}
    assert len(left) == 3
    assert files_in(tmp_path) - own == files_in(checkout) - left - own
    needed = {"CITATION.cff", "CHANGELOG.md", "Makefile", "conftest.py", "docs/index.md", "tests/test_wheel.py"}
    needed |= {"apps/timlab/tools/hatch_build.py", "apps/timlab/tools/build_editor.py"}
    needed |= {Path(folder, name).as_posix() for folder in PACKAGES for name in ("LICENSE", "README.md", "tests")}
    assert all((tmp_path / name).exists() for name in needed)
    assert (tmp_path / PAGES).exists() == (ROOT / PAGES).exists()


@pytest.mark.parametrize("folder", PACKAGES)
def test_a_wheel_holds_its_module_and_nothing_else(wheels, folder):
    names = zipfile.ZipFile(wheels[folder]).namelist()
    source = ROOT / folder / MODULES[folder]
    assert {name.split("/")[0].split("-")[0] for name in names} == {source.name}
    assert f"{source.name}/py.typed" in names
    assert not [name for name in names if "test" in name or name.endswith((".pyc", ".toml"))]
    shipped = {name for name in names if name.startswith(f"{source.name}/")}
    left = ("__pycache__", "/editor/frontend/")  # what is for those who build it
    held = {f"{source.name}/{name}" for name in files_in(source)}
    assert shipped == {name for name in held if not any(part in name for part in left)}
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_what_is_imported_is_what_was_installed(run, installed):
    modules = [Path(module).name for module in MODULES.values()]
    told = run(installed, "-c", "".join(f"import {name}; print({name}.__file__)\n" for name in modules)).split()
    assert len(told) == len(PACKAGES)
    for file in map(Path, told):
        assert installed.parents[1] in file.parents
        assert ROOT not in file.parents


OFFERED = """
import importlib.metadata
from motorgrad.commands import COMMANDS, command_named
assert all(callable(command_named(name)) for name in COMMANDS)
for distribution in ("timsim", "timlab", "motorgrad-thesis"):
    for each in importlib.metadata.distribution(distribution).entry_points:
        assert callable(each.load()), each
        print(each.group, each.name, sep=": ")
"""


def test_what_the_applications_offer_is_found(run, installed):
    offered = run(installed, "-c", OFFERED).splitlines()
    assert {f"motorgrad.commands: {name}" for name in EXTRA_OF_COMMAND} <= set(offered)
    assert {"motorgrad.lists: experiments", "motorgrad.offers: film", "motorgrad.benchmarks: lab"} <= set(offered)


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
mg.search, mg.studies, mg.plane, mg.presets, mg.statistics, mg.export
mg.environments.TaskEnv(mg.make("hopper")).reset(seed=0)
try:
    mg.environments.TaskEnv(mg.make("hopper"), render_mode="rgb_array")
except RuntimeError as error:
    print(type(error).__name__, error)
"""


def test_without_extras_a_room_can_be_used_or_names_the_one_that_it_needs(run, light):
    assert run(light, "-c", ROOMS) == f"MissingExtra a picture needs more than the library: {install('sim')}\n"


@pytest.mark.parametrize("folder", PACKAGES)
def test_a_source_distribution_installs_what_its_wheel_does(built, wheels, installed, tmp_path, folder):
    source, _ = built[folder]
    pip = [sys.executable, "-m", "pip", "--python", str(installed)]
    place = tmp_path / "from source"
    # what builds it is looked up among the dependencies of `installed`, as no network is needed here
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--target", str(place)]
    subprocess.run([*pip, "install", *options, str(source)], check=True, capture_output=True)
    module = Path(MODULES[folder]).name
    held = {name for name in zipfile.ZipFile(wheels[folder]).namelist() if name.startswith(f"{module}/")}
    assert {f"{module}/{name}" for name in files_in(place / module) if not name.endswith(".pyc")} == held


def test_a_release_is_tried_on_the_oldest_and_the_newest_python():
    # `make release` does it, as most machines have one Python
    assert project(".")[0]["requires-python"] == f">={named()[0]}"
    python = at_hand(f"{sys.version_info.major}.{sys.version_info.minor}")
    assert python is not None
    assert python.root is None
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = {canonicalize_name(Requirement(line).name) for line in lines if not line.startswith("#")}
    own = {project(folder)[0]["name"] for folder in PACKAGES}
    asked = [name for folder in PACKAGES for name in closure(project(folder)[0]["dependencies"])]
    assert {canonicalize_name(name) for name in asked} - own <= pinned
    for name in TESTS:
        assert (ROOT / name.partition("::")[0]).exists(), name


SERVES = """
import pathlib, re, socket, sys
from urllib.request import HTTPCookieProcessor, build_opener
from timlab.editor import Server, Session

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
    if not (ROOT / PAGES).exists():
        pytest.skip("the editor's pages are not built: make editor")
    served = [line.split() for line in run(installed, "-c", SERVES, tmp_path, PATH="").splitlines()]
    sizes = {kind: sum(int(size) for ending, size in served if ending == kind) for kind, _ in served}
    assert sizes["js"] > 100_000
    assert sizes["css"] > 1_000
