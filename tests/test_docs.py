"""What the documentation says is true: its Python runs and prints what it says, and its links lead somewhere.

To run all of it takes long, and is left to the share. That its blocks compile, its imports work, and that motorgrad has
every name that they use and takes what they give, is found without running them.
"""

import ast
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import motorgrad as mg
import timlab
from motorgrad.schema import PART_CLASSES
from motorgrad.tasks import TASKS
from page_code import PageCode

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("apps/*/*.md"), *ROOT.glob("thesis/*.md")])
MOST = 500  # decisions per seed that a page may train for here; docs/index.md says so
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def python_of(page: Path) -> list[str]:
    """The page's Python, with training cut short."""

    def cut(found: re.Match[str]) -> str:
        return f"steps={min(int(found[1]), MOST)}"

    text = page.read_text(encoding="utf-8")
    return [re.sub(r"\bsteps=([\d_]+)", cut, code) for kind, code in FENCE.findall(text) if kind == "python"]


def links_within(page: str) -> set[str]:
    """The pages of docs/ that a page of docs/ links to, by their paths there."""
    docs, place = (ROOT / "docs").resolve(), ROOT / "docs" / page
    targets = [(place.parent / link.partition("#")[0]).resolve() for link in LINK.findall(place.read_text("utf-8"))]
    return {target.relative_to(docs).as_posix() for target in targets if target.is_relative_to(docs)}


def anchors_of(page: Path) -> set[str]:
    """The places of a page that links may name, as GitHub makes them of headings."""
    prose = FENCE.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", prose, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.fixture
def _left_as_found(tmp_path, monkeypatch):
    (tmp_path / "apps").symlink_to(ROOT / "apps")  # a page may use a model from there
    monkeypatch.chdir(tmp_path)
    callback, tasks = mujoco.get_mjcb_act_gain(), dict(TASKS)
    kinds = {base: dict(parts) for base, parts in PART_CLASSES.items()}
    yield
    mujoco.set_mjcb_act_gain(callback)
    TASKS.clear()
    TASKS.update(tasks)
    for base, known in kinds.items():
        PART_CLASSES[base].clear()
        PART_CLASSES[base].update(known)


def check_bodies(names):
    np.testing.assert_allclose(names["state"].sensors["foot_height"], 0.50, atol=0.005)
    assert names["model"].opt.gravity[2] == -1.62
    assert names["xml"].startswith("<mujoco")


CHECKS = {"docs/bodies.md": check_bodies}
"""What else holds on a page, given the names that its blocks define."""


LONG = (
    "docs/bodies/hexapod.md",
    "docs/configuration.md",
    "docs/foreign-environments.md",
    "docs/lab/editor.md",
    "docs/plots.md",
    "docs/reproduction.md",
    "docs/reproduction-growth.md",
    "docs/reproduction-muscles.md",
    "docs/reproduction-natural.md",
    "docs/sim.md",
    "docs/tasks/hexapod.md",
    "docs/training.md",
    "docs/units/graded.md",
    "docs/units/masked.md",
    "docs/units/querying.md",
    "docs/units/spatial-index.md",
    "docs/worlds.md",
)
"""Pages whose code takes so long that only `make test-all` runs it. `make test-share` runs that of the others."""


EXTRAS = {"docs/export.md": "motorgrad[onnx]"}
"""What the code of a page needs."""


def paced(page):
    pace = pytest.mark.slow if name_of(page) in LONG else pytest.mark.ci
    needs = [pytest.mark.needs(EXTRAS[name_of(page)])] if name_of(page) in EXTRAS else []
    return pytest.param(page, marks=[pace, *needs])


@pytest.mark.usefixtures("_left_as_found")
@pytest.mark.parametrize("page", [page for page in PAGES if python_of(page)], ids=name_of)
def test_the_code_compiles_and_motorgrad_has_what_it_uses(page):
    code = PageCode()
    for number, block in enumerate(python_of(page), 1):
        code.read(block, f"{name_of(page)}, block {number}")
    assert code.faults == []
    assert code.checked > 0


@pytest.mark.usefixtures("_left_as_found")
@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("import motorgrad.lerning", "No module named 'motorgrad.lerning'"),
        ("from motorgrad.learning import ADAM", "No module named 'motorgrad.learning.ADAM'"),
        ("import motorgrad as mg\nmg.policies.hyperplane(1)", "has no 'hyperplane'"),
        ("import motorgrad as mg\nmg.learning.olgarb(dekay=0.9)", "unexpected keyword argument 'dekay'"),
        ("import motorgrad as mg\nmg.learning.SGD(1, 2, 3, 4, 5, 6)", "too many positional arguments"),
        ("import motorgrad as mg\nmg.train()", "missing a required argument: 'task'"),
        ("import motorgrad as mg\nmg.make('hopper', penalti=0.3)", "has no setting 'penalti'"),
        ("import motorgrad as mg\nrun = mg.train(1, steps=2)\nrun.plott('apex')", "Run has no 'plott'"),
        ("import motorgrad as mg\nmg.load('x').plot(colour=3)", "unexpected keyword argument 'colour'"),
        ("import timlab\ntimlab.Gane(2.0)", "has no 'Gane'"),
        ("run = mg.train('hopper', steps=2)", "no block before this line defines it"),
        ("import motorgrad as mg\ndef f(run: mg.Run):\n    return [run.seedz for _ in 'ab']", "Run has no 'seedz'"),
    ],
)
def test_what_is_wrong_in_code_is_found_without_running_it(block, said):
    code = PageCode()
    code.read(block, "page")
    (fault,) = code.faults
    assert said in fault
    with pytest.raises(SyntaxError):
        code.read("import motorgrad as", "page")


@pytest.mark.usefixtures("_left_as_found")
def test_the_first_lines_of_the_front_page_run():
    """Up to where its learners are made."""
    names: dict = {}
    first, *_, last = python_of(ROOT / "README.md")
    for block, long in ((first, "mg.train("), (last, "timlab.Run(")):
        statements = ast.parse(block).body
        quick = next(number for number, each in enumerate(statements) if long in ast.unparse(each))
        exec(compile(ast.Module(statements[:quick], []), "README.md", "exec"), names)
    assert isinstance(names["task"], mg.tasks.Task)
    assert isinstance(names["agent"], mg.Agent)
    assert isinstance(names["diagram"], timlab.Diagram)


@pytest.mark.usefixtures("_left_as_found")
@pytest.mark.parametrize("page", [paced(page) for page in PAGES if python_of(page)], ids=name_of)
def test_the_code_runs_and_prints_what_the_page_says(page, capsys):
    names: dict = {"__name__": "page"}
    for number, code in enumerate(python_of(page), 1):
        exec(compile(code, f"{name_of(page)}, block {number}", "exec"), names)
        printed = iter(capsys.readouterr().out.splitlines())
        for promised in re.findall(r"# → (.*)$", code, re.MULTILINE):
            assert promised in printed, f"block {number} prints this, in order"
    CHECKS.get(name_of(page), lambda names: None)(names)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_links_lead_somewhere(page):
    for link in LINK.findall(FENCE.sub("", page.read_text(encoding="utf-8"))):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors_of(target), link


def test_every_page_is_reached_from_the_map():
    pages = {page.relative_to(ROOT / "docs").as_posix() for page in PAGES if page.is_relative_to(ROOT / "docs")}
    found, new = {"index.md"}, {"index.md"}
    while new:  # the map itself, what it links to, and what these link to
        links = {path for page in new for path in links_within(page)}
        new = (links & pages) - found
        found |= new
    assert pages == found
