"""The library's rows: what each is called, how much work it is, and what it is to reach."""

from collections.abc import Callable
from pathlib import Path

from motorgrad._extras import require
from motorgrad.benchmarks import _bodies, _learners, _measure, _networks, _peers, _suite
from motorgrad.benchmarks._arm18 import reach18
from motorgrad.benchmarks._measure import Figures
from motorgrad.benchmarks._rows import Goal, Row
from motorgrad.tasks import Hexapod, HexapodSynergy, Hopper, from_gymnasium

FINGER = "myoFingerPoseRandom-v0"
WARM = 2
"""Seconds in which a program decides for the first time that finds what it needs compiled."""
TRAIN_ONE = ("-m", "motorgrad", "train", "hopper", "--steps", "1", "--out")


def rows() -> list[Row]:
    """The library's rows, in the order of the table."""
    return [*_of_bodies(), *_of_tendons(), *_of_worlds(), *_of_environments(), *_of_peers(), *_of_processes()]


def _of_bodies() -> list[Row]:
    def body(make: type, seeds: int, quickly: int, decisions: int):
        return lambda quick, pairs: _bodies.body(make(), seeds, quickly if quick else decisions, pairs)

    def reach(preset: str):
        return lambda quick, pairs: _bodies.composed(reach18(), preset, 16, 20 if quick else 1000, pairs)

    def finger(preset: str):
        return lambda quick, pairs: _suite.suite(FINGER, preset, 16, 20 if quick else 1000, pairs)

    bare = "learning ÷ bare physics"
    arm = "composed reach, arm of 18 muscles"
    return [
        Row("hopper-16", f"hopper, {bare}, 16 seeds", body(Hopper, 16, 50, 1500), Goal(0.96)),
        Row("hopper-1", f"hopper, {bare}, 1 seed", body(Hopper, 1, 100, 8000), Goal(0.8)),
        Row(
            "hexapod-synergies", f"hexapod on synergies, {bare}, 16 seeds", body(HexapodSynergy, 16, 20, 640), Goal(0.9)
        ),
        Row("hexapod-muscles", f"hexapod on 24 muscles, {bare}, 16 seeds", body(Hexapod, 16, 20, 640), Goal(0.95)),
        Row("reach-olgarb", f"{arm}, OLGARB, {bare}, 16 seeds", reach("olgarb"), Goal(0.85)),
        Row("reach-natural", f"{arm}, preset natural, {bare}, 16 seeds", reach("natural"), Goal(0.7)),
        Row("finger-olgarb", f"{FINGER}, OLGARB, {bare}, 16 seeds", finger("olgarb"), Goal(0.85)),
        Row("finger-natural", f"{FINGER}, preset natural, {bare}, 16 seeds", finger("natural"), Goal(0.75)),
        Row(
            "finger-own-step",
            f"{FINGER}, MyoSuite's own step ÷ mj_step",
            lambda quick, pairs: _suite.suite_step(FINGER, 20 if quick else 1000, pairs),
        ),
        Row(
            "hand-sac",
            f"{_suite.HAND}, preset sac, {bare}, 1 seed",
            lambda quick, pairs: _suite.hand(400, pairs),
            Goal(0.75),
            quick=False,
        ),
    ]


def _of_tendons() -> list[Row]:
    def tendons(body: str, first: str, second: str):
        return lambda quick, pairs: _bodies.tendons(body, first, second, 20 if quick else 2000, pairs)

    found = []
    for body, others in (("arm6", "MuJoCo's own"), ("hopper", "the thesis's"), ("myohand_r", "MuJoCo's own")):
        for end, curves, against, first, second, goal in (
            ("rigid", "", "on rigid ones", "compliant", "rigid", Goal(0.77)),
            ("others", "", others, "compliant", "plain", None),
            ("millard-rigid", " with Millard's curves", "on rigid ones", "millard", "rigid millard", Goal(0.77)),
            ("millard-degroote", " with Millard's curves", "with De Groote's", "millard", "compliant", None),
        ):
            name = f"{body}, muscles{curves} on compliant tendons ÷ {against}, 1 seed"
            found.append(Row(f"tendons-{body.partition('_')[0]}-{end}", name, tendons(body, first, second), goal))
    return found


def _of_worlds() -> list[Row]:
    def work(function, number: int, quickly: int, decisions: int):
        return lambda quick, pairs: function(number, quickly if quick else decisions, pairs)

    def index(seeds: int, quickly: int, decisions: int):
        return lambda quick, pairs: _learners.index(
            64 if quick else 4096, seeds, quickly if quick else decisions, pairs
        )

    states = "three-state OLGARB"
    eight = "linear recruitment of 8, OLGARB ÷ compiled loop"
    sixteen = "linear recruitment of 16, natural ÷ plain step"
    local = "particle with 8 local units, OLGARB ÷ compiled loop"
    many = "falling particle of 4,096 units, indexed ÷ all"
    three_states = _learners.three_states
    recruitment = _learners.recruitment
    return [
        Row("three-states-1", f"{states} ÷ compiled loop, 1 seed", work(three_states, 1, 10_000, 2_000_000), Goal(0.8)),
        Row(
            "three-states-1024",
            f"{states} ÷ compiled loop, 1,024 seeds",
            work(three_states, 1024, 100, 5000),
            Goal(0.8),
        ),
        Row(
            "three-states-sweep",
            f"{states}, sweep of 100 settings × 16 seeds ÷ one setting, 1,600 seeds",
            lambda quick, pairs: _learners.sweep(10 if quick else 100, 16, 100 if quick else 4000, pairs),
            Goal(0.9),
        ),
        Row("recruitment-1", f"{eight}, 1 seed", work(recruitment, 1, 10_000, 1_000_000), Goal(0.95)),
        Row("recruitment-1024", f"{eight}, 1,024 seeds", work(recruitment, 1024, 100, 2000), Goal(0.8)),
        Row("recruitment-natural-1", f"{sixteen}, 1 seed", work(_learners.natural_step, 1, 5_000, 300_000), Goal(0.6)),
        Row(
            "recruitment-natural-1024",
            f"{sixteen}, 1,024 seeds",
            work(_learners.natural_step, 1024, 50, 500),
            Goal(0.6),
        ),
        Row("particle-1", f"{local}, 1 seed", work(_learners.particle, 1, 5_000, 300_000), Goal(0.7)),
        Row("particle-1024", f"{local}, 1,024 seeds", work(_learners.particle, 1024, 50, 1000), Goal(0.8)),
        Row(
            "particle-episodes",
            "particle, 20 seeds × 2,000 episodes, with compilation",
            lambda quick, pairs: _learners.local_learning(20, 20 if quick else 2000),
            Goal(15, "s", at_most=True),
        ),
        Row("index-1", f"{many}, 1 seed", index(1, 200, 5_000), Goal(8)),
        Row("index-20", f"{many}, 20 seeds", index(20, 20, 500)),
        Row(
            "network",
            "policy and critic of 2 × 128, one stream ÷ torch",
            lambda quick, pairs: _networks.network(100 if quick else 10_000, 20 if quick else 1_000, pairs),
            Goal(10_000, "steps/s"),
        ),
    ]


def _of_environments() -> list[Row]:
    def shared(make, decisions: int):
        return lambda quick, pairs: _bodies.shared(make(), 16, 20 if quick else decisions, pairs)

    env_id = _bodies.HOPPER
    ends = "one natural learner of 16 environments ÷ 16 learners of one"
    return [
        Row(
            "env-vector",
            f"{env_id}, vector of 16 ÷ bare physics",
            lambda quick, pairs: _bodies.vector(16, 20 if quick else 1500, pairs),
            Goal(0.9),
        ),
        Row(
            "env-single",
            f"{env_id}, single ÷ mj_step",
            lambda quick, pairs: _bodies.single(50 if quick else 5000, pairs),
            Goal(0.75),
        ),
        Row(
            "cartpole",
            "CartPole-v1, learning ÷ bare environments, 10 seeds",
            lambda quick, pairs: _bodies.foreign(10, 50 if quick else 5000, pairs),
            Goal(0.75),
        ),
        Row("shared-pendulum", f"Pendulum-v1, {ends}", shared(lambda: from_gymnasium("Pendulum-v1"), 500)),
        Row("shared-hopper", f"hopper, {ends}", shared(Hopper, 500)),
    ]


def _of_peers() -> list[Row]:
    return [
        Row(
            f"{_peers.SHORT}-{preset}",
            f"{_peers.ENVIRONMENT}, preset {preset} ÷ PPO of SBX, 1 seed",
            lambda quick, pairs, preset=preset: _peers.learning(preset, 1 if quick else 4, 1 if quick else pairs),
            Goal(2),
            quick=False,
        )
        for preset in _peers.PRESETS
    ]


def _of_processes() -> list[Row]:
    def first(command: Callable[[Path], list[str]], needed: str, warm: bool):
        def measure(quick: bool, pairs: int) -> Figures:
            if needed:
                require("this row needs", needed, needed)
            return _measure.first_decision(command, warm, min(pairs, 3))

        return measure

    suite = "myosuite"
    finger = _suite.ONE_DECISION.format(task=FINGER, actions="binary", preset="natural")
    hand = _suite.ONE_DECISION.format(task=_suite.HAND, actions="continuous", preset="sac")
    starts = (
        ("hopper", "motorgrad train hopper", lambda out: [*TRAIN_ONE, str(out)], "", 5),
        ("finger", f"natural on {FINGER}", lambda out: ["-c", finger], suite, 10),
        ("hand", f"sac on {_suite.HAND}", lambda out: ["-c", hand], suite, 15),
    )
    heights = _bodies.learned_heights
    return [
        Row(
            "import",
            "import motorgrad",
            lambda quick, pairs: _measure.started(["-c", "import motorgrad"], pairs),
            Goal(0.3, "s", at_most=True),
        ),
        Row(
            "help",
            "motorgrad --help",
            lambda quick, pairs: _measure.started(["-m", "motorgrad", "--help"], pairs),
            Goal(0.6, "s", at_most=True),
        ),
        *(
            Row(
                f"first-{short}-{'warm' if warm else 'cold'}",
                f"first decision, {words}, {'warm' if warm else 'cold'} compilation cache",
                first(command, needed, warm),
                Goal(WARM if warm else cold, "s", at_most=True),
                quick=False,
            )
            for short, words, command, needed, cold in starts
            for warm in (False, True)
        ),
        Row(
            "memory-hoppers",
            "peak memory, 16 hoppers",
            lambda quick, pairs: _measure.peak_of(_measure.HOPPERS),
            Goal(0.4, "GB", at_most=True),
        ),
        Row(
            "memory-hand-sac",
            f"peak memory, sac on {_suite.HAND}",
            lambda quick, pairs: _suite.hand_memory(),
            Goal(0.8, "GB", at_most=True),
            quick=False,
        ),
        Row(
            "memory-seed",
            "memory of a seed, particle with 8 local units",
            lambda quick, pairs: _measure.memory_of_a_seed(),
        ),
        *(
            Row(
                f"apex-{kind}-{str(decay).partition('.')[2]}",
                f"hopper rewarded at {kind}, decay {decay}, 16 seeds: apex > {_bodies.HEIGHT} m",
                lambda quick, pairs, kind=kind, decay=decay: heights(
                    kind, decay, 2 if quick else 16, 50.0 if quick else 1500.0
                ),
            )
            for kind, decay in _bodies.SETTINGS
        ),
    ]
