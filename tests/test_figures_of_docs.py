"""The documentation's figures: every one can be drawn, is in place, is shown on a page, and is light."""

import dataclasses
import functools
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from motorgrad import bodies, learning, policies
from motorgrad.tasks import TASKS
from timlab import GALLERY

ROOT = Path(__file__).parents[1]
KINDS = ("units", "estimators", "bodies", "tasks")
LIGHT = 200_000  # bytes
LIGHT_FILM = 2_000_000


@pytest.fixture(scope="module", autouse=True)
def _from_the_root():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        yield


@functools.cache
def pages():
    """The text of every page, read once."""
    return [page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md")]


def names(kind):
    """The figures' names, without importing what draws them."""
    text = (ROOT / "tools" / "figures" / "_registry.py").read_text(encoding="utf-8")
    return re.findall(r'^    "([\w-]+)":', text.partition(f"{kind}: ")[2].partition("\n}")[0], re.MULTILINE)


DRAWN, MEASURED, FILMS = names("DRAWN"), names("MEASURED"), names("FILMS")
MARKS = {
    "estimator-gpomdp": pytest.mark.ci,
    "unit-motoneuron": pytest.mark.ci,
    "holding": pytest.mark.needs("motorgrad[myosuite]"),
}


def test_the_names_are_those_of_the_registry():
    from tools.figures._registry import FIGURE_NAMES

    assert (*DRAWN, *MEASURED, *FILMS) == FIGURE_NAMES


@pytest.mark.representatives("hexapod-muscles")
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=MARKS.get(name, ())) for name in (*DRAWN, *MEASURED)],
)
def test_a_figure_is_drawn(name, tmp_path):
    from tools.figures.__main__ import draw
    from tools.figures._work import Work

    draw(name, Work(most=100), tmp_path / "figure.png")
    picture = np.asarray(Image.open(tmp_path / "figure.png").convert("L"))
    assert picture.shape[1] > 1000
    assert 0.005 < (picture < 200).mean() < 0.9  # neither empty nor full


@pytest.mark.parametrize("name", [*DRAWN, *MEASURED])
def test_a_figure_is_in_place(name):
    assert 0 < (ROOT / "docs" / "images" / f"{name}.png").stat().st_size <= LIGHT
    shown = rf"!\[[^\]]{{20,}}\]\([^)]*images/{name}\.png\)"  # with words for those who cannot see it
    assert any(re.search(shown, page) for page in pages() if f"images/{name}.png" in page)


@pytest.mark.parametrize("name", FILMS)
def test_a_film_is_in_place_and_moves(name):
    path = ROOT / "docs" / "images" / f"{name}.webp"
    assert 0 < path.stat().st_size <= LIGHT_FILM
    with Image.open(path) as film:
        assert film.n_frames > 50
    front = ["README.md", "docs/index.md"] if name == FILMS[0] else []
    for page in (ROOT / path for path in ("docs/gallery.md", *front)):
        assert re.search(rf"!\[[^\]]{{20,}}\]\([^)]*images/{name}\.webp\)", page.read_text(encoding="utf-8")), page.name


def test_replays_are_in_place_and_the_gallery_leads_to_them():
    from tools.figures._registry import REPLAYS

    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert {path.stem for path in (ROOT / "docs" / "images").glob("*.html")} == set(REPLAYS) <= set(FILMS)
    for name in REPLAYS:
        assert (ROOT / "docs" / "images" / f"{name}.html").stat().st_size <= LIGHT_FILM
        assert f"](images/{name}.html)" in page


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.ci if name == FILMS[0] else ()) for name in FILMS]
)
def test_a_film_is_made(name, tmp_path):
    from tools.figures._registry import FILMS
    from tools.figures._work import Work

    before, after = FILMS[name](Work(most=200))
    assert before.seconds == after.seconds > 4
    assert (before.position != after.position).any()


def test_every_diagram_of_the_gallery_has_a_picture_that_shows_its_blocks():
    for name, make in GALLERY.items():
        picture = (ROOT / "docs" / "images" / f"lab-{name}.svg").read_text(encoding="utf-8")
        assert [block for block in make().nodes if f">{block}</text>" not in picture] == [], name


@pytest.mark.parametrize("kind", KINDS)
def test_every_page_of_a_kind_has_a_figure(kind):
    for page in (ROOT / "docs" / kind).glob("*.md"):
        assert re.search(r"!\[[^\]]{20,}\]\(\.\./images/", page.read_text(encoding="utf-8")), page.name


def public(room, kind):
    """The concrete classes of a kind that a room offers."""
    things = [getattr(room, name) for name in room.__all__]
    return [t.__name__ for t in things if isinstance(t, type) and issubclass(t, kind) and not inspect.isabstract(t)]


def test_every_unit_and_every_part_of_an_estimator_is_on_a_page():
    for folder, found in (
        ("units", public(policies, policies.Policy)),
        ("estimators", [*public(learning, (learning.Trace, learning.Baseline)), "SGD", "Adam"]),
    ):
        text = "\n".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / folder).glob("*.md"))
        assert len(found) >= 6
        assert [name for name in found if f"{name}(" not in text] == []


def test_every_estimator_body_and_task_has_its_page():
    stems = {kind: {page.stem for page in (ROOT / "docs" / kind).glob("*.md")} for kind in KINDS}
    assert set(learning.Estimator.presets) <= stems["estimators"]
    described = [
        name
        for name in bodies.__all__
        if dataclasses.is_dataclass(thing := getattr(bodies, name)) and hasattr(thing, "spec")
    ]
    pages = {"OnTerrain": "terrain", "WithSensors": "mjcf"}  # any body, on ground of its own, with more sensors
    assert {pages.get(name, name.lower()) for name in described} == stems["bodies"]
    assert set(TASKS) - {"gymnasium"} == stems["tasks"]  # that one is any environment at all
