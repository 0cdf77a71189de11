"""The experiments on the hexapod: each from end to end at its smoke size, and how claims are judged."""

import dataclasses

import numpy as np
import pytest

from motorgrad.bodies import (
    LEGS,
    TRIPODS,
    Hexapod,
    LegState,
    TripodController,
    biomimetic_hexapod,
    compile_model,
    walk,
)
from motorgrad.learning import MeanReward
from motorgrad_thesis import EXPERIMENTS
from motorgrad_thesis.chapter_5.hexapod._drawing import Places
from motorgrad_thesis.chapter_5.hexapod._gait_study import GAITS
from motorgrad_thesis.chapter_5.hexapod.figure_5_7 import draw_machine
from motorgrad_thesis.chapter_5.hexapod.figure_5_8 import clearest, movement
from motorgrad_thesis.chapter_5.hexapod.figure_5_9 import (
    FRONT_FEET,
    HIND_FEET,
    slip,
    with_friction,
    with_low_front,
)

CLAIMED = {
    "fig-5.6": 0,
    "fig-5.7": 5,
    "sec-5.3.3-terrain": 28,
    "fig-5.8": 4,
    "sec-5.3.4-gaits": 18,
    "sec-5.3.4-olgarb": 3,
    "fig-5.9": 6,
    "sec-5.4.1-biomimetic": 3,
}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo notes divergences in the working directory


LONG = dict.fromkeys(CLAIMED, pytest.mark.slow) | dict.fromkeys(("fig-5.6", "fig-5.7"), pytest.mark.ci)


@pytest.mark.parametrize("name", [pytest.param(n, marks=LONG.get(n, ())) for n in CLAIMED])
def test_each_leaves_a_figure_and_its_claims(name, done, check_complete):
    found = done(name)
    check_complete(name, found)
    assert len(found.claims) == CLAIMED[name]


@pytest.mark.slow
def test_the_learned_ones_share_their_runs(out, done):
    for name in ("fig-5.8", "sec-5.3.4-gaits"):
        done(name)
    assert len(list((out / "trained").glob("[!.]*"))) == len(EXPERIMENTS["fig-5.8"].quick().lags)


def test_they_stand_in_the_order_of_the_source():
    assert [name for name in EXPERIMENTS if name in CLAIMED] == list(CLAIMED)


def test_olgarb_has_a_unit_for_each_muscle():
    task = EXPERIMENTS["sec-5.3.4-olgarb"]().task
    np.testing.assert_array_equal(task.drives, np.eye(24))
    assert (task.lag, task.observes, task.reward_type) == (0, ("lateral",), "heading")


def test_the_default_learner_is_the_thesis_s():
    for name in ("fig-5.8", "sec-5.3.4-gaits"):
        study = EXPERIMENTS[name]()
        agent = study.learner(0)
        assert (agent.estimator.trace.decay, agent.optimizer.learning_rate) == (0.97, 1e-3)
        assert (study.task(0).period, type(agent.estimator.baseline)) == (0.02, MeanReward)
        assert (study.seeds, study.seconds, study.lags) == (20, 600.0, (0, 1, 2))
        assert study.task(2).lag == 2


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("fig-5.7", {"seconds": 0.0}, "seconds = 0"),
        ("fig-5.7", {"seeds": 1}, "seeds = 1"),
        ("sec-5.3.3-terrain", {"heights": (0.1, 0.05, 0.2)}, "heights = "),
        ("sec-5.3.3-terrain", {"clearance": 0.3}, "clearance = 0.3"),
        ("sec-5.3.3-terrain", {"seconds": 60.0}, "seconds = 60"),
        ("fig-5.8", {"shown": 0.0}, "shown = 0"),
        ("fig-5.8", {"lags": ()}, r"lags = \(\)"),
        ("sec-5.3.4-gaits", {"lags": (1, 0)}, "lags = "),
        ("sec-5.3.4-gaits", {"lags": (-1, 0)}, r"lags\[0\] = -1"),
        ("sec-5.3.4-gaits", {"seeds": 1}, "seeds = 1"),
        ("sec-5.3.4-gaits", {"watched": 4.0}, "watched = 4"),
        ("sec-5.3.4-gaits", {"decay": 1.5}, "decay = 1.5"),
        ("sec-5.3.4-gaits", {"seconds": float("nan")}, "seconds = nan"),
        ("fig-5.9", {"frictions": (0.4,)}, "frictions = "),
        ("fig-5.9", {"highest": -5.0}, "highest = -5"),
        ("fig-5.9", {"height": 0.0}, "height = 0"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)


# the bodies and the controller, drawn


@pytest.mark.parametrize("body", [Hexapod(), biomimetic_hexapod()], ids=["plain", "biomimetic"])
def test_parts_are_named_where_they_are(body):
    side, above = Places(body, "side"), Places(body, "above")
    for leg in LEGS:
        # every foot stands on the floor with its capsule's end
        radius = body.sections[leg.partition("_")[2]].leg.foot.radius
        assert side.tip(leg)[1] == pytest.approx(radius, abs=1e-6)
        assert np.sign(above.tip(leg)[1]) == (1 if leg.startswith("left") else -1)
    ahead = above.joint("front") - above.joint("rear")
    np.testing.assert_allclose(ahead, (2 * body.spacing, 0.0), atol=1e-9)
    # a protractor pulls forward: it begins before the hip
    assert above.muscle("protractor_left_middle", 0.0)[0] > above.joint("coxa_left_middle")[0]


def test_the_diagram_has_the_controller_s_own_numbers():
    from matplotlib.figure import Figure

    def words(controller):
        axes = Figure().subplots()
        draw_machine(axes, controller)
        return " ".join(text.get_text() for text in axes.texts).replace("\n", " ")

    shown = words(TripodController(back=-17.0, forward=13.0, stance=2.5, swing=7.0, contact=0.7, margin=2.0))
    for state in LegState:
        assert state.name.lower() in shown
    for number in ("−17°", "13°", "−2.5 rad/s", "+7 rad/s", "0.7 N", "within 2°"):
        assert number in shown
    assert "lower limit" not in words(TripodController(mended=False))


# claims, both ways


def test_the_walk_s_claims_see_another_gait():
    kind = EXPERIMENTS["fig-5.7"]()
    noise = 1e-3 * np.random.default_rng(0).normal(size=20)
    length = Hexapod().length
    right = {
        "kind": np.full(20, "tripod"), "phase": 0.48 + noise, "duty": 0.44 + noise,
        "speed": 0.68 * length + noise, "frequency": 2.0 + noise,
    }  # fmt: skip
    assert [claim.holds for claim in kind.claims(right)] == [True] * 5
    wrong = {
        "kind": np.array(["tripod"] * 19 + ["pronk"]), "phase": 0.3 + noise, "duty": 0.6 + noise,
        "speed": 0.3 + noise, "frequency": 1.0 + noise,
    }  # fmt: skip
    assert [claim.holds for claim in kind.claims(wrong)] == [False] * 5


def rough(study, tripod, net, still_mended, still_worded, overturned):
    """Made-up walks of 20 seeds at every height."""
    values = {"height": np.array([0.0, *study.heights])}
    shape, noise = (len(values["height"]), study.seeds), 1e-3 * np.random.default_rng(0).normal(size=20)
    for kind in ("bumps", "slopes", "steps", "waves"):
        for wording, still in (("mended", still_mended), ("worded", still_worded)):
            values |= {
                f"{kind} {wording} gait": np.full(shape, "tripod" if tripod else "intermediate"),
                f"{kind} {wording} net": np.linspace(0.5, net, shape[0])[:, None] + noise,
                f"{kind} {wording} phase": np.full(shape, 0.5) + noise,
                f"{kind} {wording} still": np.full(shape, still),
                f"{kind} {wording} overturned": np.full(shape, overturned),
            }
    return values


def test_terrain_claims_hold_of_robust_walks_and_not_of_others():
    study = EXPERIMENTS["sec-5.3.3-terrain"]()
    robust = list(study.claims(rough(study, True, 0.5, False, True, False)))
    assert [claim.holds for claim in robust] == [True] * 24 + [False] + [True] * 3
    assert {claim.kind for claim in robust if "lower limit" in claim.statement} == {"extension", "reference model"}
    frail = list(study.claims(rough(study, False, 0.1, True, False, True)))
    assert [claim.holds for claim in frail] == [False] * 24 + [True] + [False] * 3
    study.figure(rough(study, True, 0.5, False, True, False))


def test_two_grounds_of_twenty_without_a_tripod_gait_refute_consistency():
    study = EXPERIMENTS["sec-5.3.3-terrain"]()
    for others, holds in ((1, True), (2, False)):
        values = rough(study, True, 0.5, False, True, False)
        values["steps worded gait"][2, :others] = "stalled"
        first = next(claim for claim in study.claims(values) if "tripod gait on steps up to" in claim.statement)
        assert first.holds == holds


def learned(study, shares, speed, net, passed):
    """Made-up seeds: of each class a share in the order of `GAITS`, alike in all lags and with both kinds of action."""
    counts = np.round(study.seeds * np.array(shares)).astype(int)
    noise, time = 1e-3 * np.random.default_rng(0).normal(size=study.seeds), np.linspace(6.0, 600.0, 100)
    values = {"time": time, "controller speed": np.array([0.5]), "controller net": np.array([0.5])}
    for lag in study.lags:
        values |= {
            f"lag {lag} practice": np.tile(speed + noise[:, None], (1, 100)),
            f"lag {lag} falls": np.zeros(study.seeds),
            f"lag {lag} passed": passed + noise,
        }
        for mode in ("sample", "mode"):
            values |= {
                f"lag {lag} {mode} gait": np.repeat(GAITS, counts),
                f"lag {lag} {mode} speed": speed + noise,
                f"lag {lag} {mode} net": net + noise,
                f"lag {lag} {mode} stalls": np.zeros(study.seeds),
            }
    return values


def test_learned_gaits_are_judged_by_their_classes_speeds_and_distances():
    study = EXPERIMENTS["sec-5.3.4-gaits"]()
    pronking = learned(study, (0.1, 0.9, 0.0, 0.0), 2.0, 1.0, 60.0)
    for claim in study.claims(pronking):
        assert claim.holds == ("Without lag" not in claim.statement and "more seeds learn" not in claim.statement)
    between = learned(study, (0.0, 0.0, 0.5, 0.5), 0.4, 0.1, 600.0)
    assert not any(claim.holds for claim in study.claims(between))
    later = pronking | {"lag 0 sample gait": np.full(20, "intermediate")}
    held = {claim.statement: claim.holds for claim in study.claims(later)}
    assert held["Without lag, gaits lie between tripod and pronk."]
    assert held["With observations delayed by 2, more seeds learn tripod or pronk than with 0."]
    assert not held["The tripod gait is learned."]
    study.figure(between)


def test_a_seed_that_never_passes_the_controller_is_not_soon():
    study = EXPERIMENTS["sec-5.3.4-gaits"](seconds=20.0)
    values = learned(study, (0.5, 0.5, 0.0, 0.0), 2.0, 1.0, 20.0) | {"time": np.array([10.0, 20.0])}
    for claim in study.claims(values):
        assert not (claim.holds and "exceeds the fixed" in claim.statement)


def test_the_clearest_seed_of_a_class_is_shown_and_none_of_another():
    gaits = np.array(["tripod", "pronk", "tripod", "intermediate"])
    correlation = np.array([-0.5, 0.4, -0.9, 0.99])
    assert [clearest(gaits, correlation, kind) for kind in ("tripod", "pronk", "stalled")] == [2, 1, -1]


def stride(shift):
    """Six legs, one cycle a second, the second tripod behind by a part of it: angles and feet on the ground."""
    time = np.arange(0.0, 4.0, 0.02)
    phase = np.array([0.0 if leg in TRIPODS[0] else shift for leg in LEGS])
    wave = np.sin(2 * np.pi * (time[:, None] - phase))
    return wave[None], (wave < 0.2)[None]


def test_how_legs_move_together():
    jumping, walking = movement(*stride(0.0)), movement(*stride(0.5))
    for each in (jumping, walking):
        np.testing.assert_allclose(each["within"], 1.0)
    np.testing.assert_allclose(jumping["all six"], 1.0)
    assert walking["all six"] < 0
    assert jumping["airborne"] > 0.3
    assert walking["airborne"] < 0.01
    standing = movement(np.zeros((1, 50, 6)), np.ones((1, 50, 6), bool))
    assert standing["airborne"] == 0
    assert np.isnan([standing["all six"], standing["within"]]).all()


def test_the_two_gaits_claims_are_of_the_seeds_of_each_class():
    kind = EXPERIMENTS["fig-5.8"]()
    values = {"gait": np.repeat(["pronk", "tripod", "intermediate"], 8)}
    right = np.repeat([1.0, -0.2, 0.0], 8)
    values |= {"all six": right, "airborne": 0.2 * (right > 0), "within": np.full(24, 0.9), "feet": right}
    assert [claim.holds for claim in kind.claims(values)] == [True] * 4
    swapped = values | {"gait": np.repeat(["tripod", "pronk", "intermediate"], 8), "within": np.zeros(24)}
    assert [claim.holds for claim in kind.claims(swapped)] == [False] * 4
    none = list(kind.claims(values | {"gait": np.full(24, "stalled")}))
    assert [claim.holds for claim in none] == [False] * 4
    assert all("None of 24 seeds" in claim.note for claim in none)


def test_the_biomimetic_claims_see_differences_on_the_same_ground():
    study = EXPERIMENTS["fig-5.9"](frictions=(0.4, 1.6))
    ground = np.random.default_rng(0).normal(size=20)

    def values(sign):
        made = {"friction": np.array(study.frictions)}
        better = {"as it is", "front 0.4", "behind 1.6"}
        for name in study.bodies():
            step = sign * (0.1 if name in better else 0.05 if name == "front 1.6" else 0.0)
            made |= {f"{name} {each}": ground + step for each in ("speed", "net", "early", "yaw")}
            made[f"{name} slip"] = ground - step
        return made

    noise = 1e-3 * np.random.default_rng(1).normal(size=20)
    for sign in (1, -1):
        made = {name: each + (noise if "plain" in name else 0) for name, each in values(sign).items()}
        assert [claim.holds for claim in study.claims(made)] == [sign > 0] * 6
    study.figure(values(1))


# the variants of the biomimetic body


def test_variants_differ_in_what_they_say_only():
    body = biomimetic_hexapod("servos")
    changed = with_friction(body, ("middle", "rear"), 0.3)
    frictions = [section.leg.friction for section in changed.sections.values()]
    assert frictions == [body.front.leg.friction, 0.3, 0.3]
    assert with_friction(changed, ("middle",), 1.2) == with_friction(body, ("rear",), 0.3)
    low = with_low_front(body, 0.0)
    model, before = compile_model(low), compile_model(body)
    for leg in LEGS:
        least, greatest = np.degrees(model.joint(f"vertical_{leg}").range)
        assert least == pytest.approx(np.degrees(before.joint(f"vertical_{leg}").range[0]))
        assert (greatest == pytest.approx(0.0)) == leg.endswith("front")


def test_feet_in_the_air_have_no_slip():
    body = biomimetic_hexapod("servos")
    found = walk(body, seconds=0.1)
    still = found.reading._replace(contact=np.zeros_like(found.reading.contact))
    assert np.isnan(slip(dataclasses.replace(found, reading=still), body, HIND_FEET)).all()


@pytest.mark.ci
def test_slippery_feet_slip_more():
    body = biomimetic_hexapod("servos")
    slides = []
    for friction in (0.1, 1.6):
        feet = with_friction(body, ("middle", "rear"), friction)
        slides.append(np.nanmean(slip(walk(feet, seconds=3.0), feet, HIND_FEET)[100:]))
    assert slides[0] > 1.3 * slides[1]
    assert sorted(FRONT_FEET + HIND_FEET) == list(range(6))
