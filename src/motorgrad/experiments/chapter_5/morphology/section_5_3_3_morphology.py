"""Sections 5.3.3 and 5.4.1: a search for the hexapod's body, for the fixed controller's speed."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5.morphology._body_space import PITCH, SPACE, YAW, jittered, usual_numbers
from motorgrad.experiments.chapter_5.morphology._morphology_claims import judge
from motorgrad.experiments.chapter_5.morphology._morphology_figure import draw_morphology
from motorgrad.experiments.chapter_5.morphology._observations import chance_bodies, observe, usual_bodies
from motorgrad.experiments.chapter_5.morphology._walking import SETTLING, walked, walked_in_turn
from motorgrad.search import Boltzmann, CmaEs, Method, Uniform, search

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("cma-es", "boltzmann", "uniform")


@dataclasses.dataclass(frozen=True)
class Morphology(Experiment):
    """A search for the hexapod's body: 15 of its numbers, so that it is fast under the fixed controller. CMA-ES, the
    thesis's random search with Boltzmann selection and random sampling, with as many evaluations each; the body that
    each search calls the best walks again, often. Which of its numbers made the best body fast; and what the thesis
    observed: a wide heavy trunk against a slim light one, and vertical against lateral joints between the sections.

    **Arguments:**

    - `evaluations`: bodies that a search tries, a multiple of `batch`.
    - `searches`: of each method, at least 2.
    - `batch`: bodies of a search that walk together, at least 4.
    - `seconds` (simulated s): length of every walk, of which the first does not count.
    - `again`: walks by which a number is judged, of bodies that differ by too little to matter; at least 2.
    - `bodies`: bodies at random places, of which variants are compared; at least 2.
    - `temperature`: of Boltzmann selection, in standard deviations of the scores.
    - `changed`: numbers that Boltzmann selection moves at a time.
    - `width`: standard deviation of its noise, in parts of a number's range.
    """

    name: ClassVar[str] = "sec-5.3.3-morphology"
    title: ClassVar[str] = "a search for the hexapod's body"
    source: ClassVar[str] = "section 5.3.3"
    needs: ClassVar[tuple[str, str] | None] = ("evosax", "search")

    evaluations: int = 240
    searches: int = 5
    batch: int = 12
    seconds: float = 4.0
    again: int = 12
    bodies: int = 40
    temperature: float = Boltzmann.temperature
    changed: int = Boltzmann.changed
    width: float = Boltzmann.width

    def __post_init__(self) -> None:
        for name, least in (("searches", 2), ("batch", 4), ("again", 2), ("bodies", 2)):
            check(least <= getattr(self, name) <= 10_000, name, getattr(self, name), f"in {least} … 10,000")
        whole = self.evaluations >= self.batch and self.evaluations % self.batch == 0
        check(whole, "evaluations", self.evaluations, f"a multiple of batch = {self.batch}")
        self.method("boltzmann")
        check(SETTLING + 1 <= self.seconds <= 3600, "seconds", self.seconds, f"in {SETTLING + 1:g} … 3600 simulated s")

    @classmethod
    def quick(cls) -> Self:
        return cls(evaluations=12, searches=2, batch=6, seconds=2.0, again=2, bodies=2)

    def method(self, kind: str) -> Method:
        """A method of search, with as many candidates to a round as the others."""
        if kind == "cma-es":
            return CmaEs(population=self.batch)
        if kind == "boltzmann":
            return Boltzmann(self.batch, self.temperature, self.changed, self.width)
        return Uniform(candidates=self.batch)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for kind in KINDS:
            each = [
                work.part(f"{kind} {number}", lambda kind=kind, number=number: self._search(work, kind, number))
                for number in range(self.searches)
            ]
            found |= {f"{kind} {name}": np.stack([one[name] for one in each]) for name in each[0]}
        found |= {"usual": work.part("usual", lambda: self._often(work, [usual_numbers()], 0))["speed"][0]}
        best = int(np.argmax(found["cma-es again"].mean(axis=1)))
        numbers = dict(zip(SPACE.names, found["cma-es best"][best].tolist(), strict=True))
        found |= work.part("what helped", lambda: self._helped(work, numbers))
        for name, make in (("usual", usual_bodies), ("chance", chance_bodies)):
            count = self.again if name == "usual" else self.bodies
            bodies = make(count, np.random.default_rng(2))
            seen = work.part(f"{name} bodies", lambda bodies=bodies: observe(bodies, self.seconds, work.threads))
            found |= {f"{name} {measure}": values for measure, values in seen.items()}
        return found

    def _search(self, work: Workspace, kind: str, number: int) -> Values:
        """All that a search tries; the numbers that it calls the best; and how fast these are, again and again."""
        done = search(
            lambda candidates, random: walked(candidates, self.seconds, work.threads)["speed"],
            SPACE,
            self.method(kind),
            evaluations=self.evaluations,
            seed=number,
            progress=work.progress,
        )
        best = done.best
        again = self._often(work, [best], number)
        return {
            "candidates": done.candidates,
            "scores": done.scores,
            "best": np.array(list(best.values())),
            "again": again["speed"][0],
            "duty": again["duty"][0],
        }

    def _often(self, work: Workspace, each: list[dict[str, float]], seed: int) -> Values:
        """Walks of bodies with changes too small to matter: (bodies, again). One that falls apart has a speed of 0."""
        random = np.random.default_rng([1, seed])
        bodies = [copy for numbers in each for copy in jittered(numbers, self.again, random)]
        found = walked_in_turn(bodies, self.seconds, work.threads)
        return {name: np.nan_to_num(values).reshape(len(each), self.again) for name, values in found.items()}

    def _helped(self, work: Workspace, best: dict[str, float]) -> Values:
        """The usual body with each number of the best one, and the best body with each number of the usual one."""
        usual = usual_numbers()
        best = {**best, "axis": YAW if best["axis"] > 0.5 else PITCH}
        changed = [{**usual, name: best[name]} for name in SPACE.names]
        undone = [{**best, name: usual[name]} for name in SPACE.names]
        speed = self._often(work, [usual, best, *changed, *undone], 1000)["speed"]
        size = SPACE.size
        return {
            "compared": speed[:2],
            "changed": speed[2 : 2 + size],
            "undone": speed[2 + size :],
            "found": np.array(list(best.values())),
        }

    def figure(self, values: Values) -> "Figure":
        return draw_morphology(values, KINDS)

    def claims(self, values: Values) -> Sequence[Claim]:
        return judge(values, self.evaluations)
