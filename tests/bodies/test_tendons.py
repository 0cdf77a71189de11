"""Hill-type muscles: published curves, two experiments against a fine integration, and bodies that have them."""

import dataclasses
import pickle
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from motorgrad import bodies
from motorgrad.bodies import Anatomy, Attachment, BodyBatch, Hill, HillMuscle, Mjcf, contract, read_hill
from motorgrad.bodies.muscles._hill_dynamics import activation_rate, next_activation, rigid_tension
from motorgrad.schema import build, table

SOLEUS = Hill(1000.0, optimal_fiber_length=0.1, tendon_slack_length=0.2, pennation_angle=0.3)
MUSCLES = {name: dataclasses.replace(SOLEUS, curves=name) for name in bodies.CURVES}
HELD = 0.2 * 1.01 + 0.1 * np.cos(0.3)  # m
RELEASE = {"activation": 1.0, "release": 0.02, "load": 500.0, "mass": 20.0}


def left_to_share(*values):
    """Values of a parameter that `make test-share` tries."""
    return [pytest.param(value, marks=pytest.mark.ci) for value in values]


@pytest.fixture(params=MUSCLES)
def muscle(request):
    """The same muscle with either set of curves."""
    return MUSCLES[request.param]


@pytest.fixture(scope="module")
def reference():
    """The integration that the figures show; its formulas are written out anew."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[2]))
        from tools.figures.tendons import reference
    return reference


def arm(**changes) -> Mjcf:
    return Mjcf("arm6", muscle_model="hill", **changes)


# computed with 40 digits from the formulas; first with OpenSim's coefficients, then with those that the paper prints
FORCE_LENGTH = {
    0.4: (0.0255412176, 0.0255684481),
    0.7: (0.6842332768, 0.6825779377),
    1.0: (1.0000000000, 0.9993334763),
    1.3: (0.5811888984, 0.5793537927),
    1.6: (0.1242550385, 0.1228795547),
}
FORCE_VELOCITY = {
    -1.0: (0.0000000000, 0.0120816781),
    -0.5: (0.2340363935, 0.2438336294),
    0.0: (1.0000000000, 1.0023206225),
    0.3: (1.4475690712, 1.4455209471),
    1.0: (1.7943429636, 1.7889099603),
}
PASSIVE = {
    0.2: (0.0000000000, -0.0185672836),
    0.8: (0.0047399421, -0.0137393336),
    1.0: (0.0182288238, 0.0000000000),
    1.3: (0.1352588168, 0.1192029220),
    1.6: (1.0000000000, 1.0000000000),
}
TENDON = {
    0.99: (-0.0612529947, -0.0821085958),
    1.0: (0.0000000000, -0.0117507567),
    1.02: (0.2155686246, 0.2297750588),
    1.0474: (0.9318066091, 1.0017744286),
    1.049: (1.0000000000, 1.0738737362),
    1.06: (1.5941892963, 1.6955838025),
}
PRINTED = (((0.815, 1.055, 0.162, 0.063), (0.433, 0.717, -0.030, 0.200), (0.1, 1.0, 0.354, 0.0)),)
CURVES = {
    "active": (bodies.active_force_length, FORCE_LENGTH, PRINTED),
    "velocity": (bodies.force_velocity, FORCE_VELOCITY, ((-0.318, -8.149, -0.374, 0.886),)),
    "passive": (bodies.passive_force_length, PASSIVE, (1.0,)),
    "tendon": (bodies.tendon_force_length, TENDON, (np.log(1.25 / 0.2) / 35 - 0.005, (0.2, 0.995, 0.25))),
}


@pytest.mark.parametrize("curve", CURVES)
def test_curves_are_the_published_ones(curve):
    function, known, printed = CURVES[curve]
    places, values = np.array(list(known)), np.array(list(known.values()))
    np.testing.assert_allclose(function(places), values[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(function(places, *printed), values[:, 1], rtol=0, atol=1e-9)


def test_curves_pass_through_the_points_that_define_them():
    assert bodies.active_force_length(1.0) == pytest.approx(1.0, abs=1e-12)
    assert bodies.force_velocity(-1.0) == pytest.approx(0.0, abs=1e-12)
    assert bodies.force_velocity(0.0) == pytest.approx(1.0, abs=1e-12)
    assert bodies.passive_force_length(0.2) == 0.0
    for strain in (0.03, 0.049, 0.1):
        assert bodies.tendon_force_length(1.0, strain) == 0.0
        assert bodies.tendon_force_length(1.0 + strain, strain) == pytest.approx(1.0, abs=1e-12)
        # its slope at the slack length is c1 kT
        slope = (bodies.tendon_force_length(1.0 + 1e-7, strain) - bodies.tendon_force_length(1.0, strain)) / 1e-7
        assert slope == pytest.approx(0.2 * np.log(6) / strain, rel=1e-4)


def test_activation_follows_its_equation():
    for start, excitation in ((0.0, 1.0), (1.0, 0.1), (0.2, 0.7)):

        def rate(_, a, excitation=excitation):
            return activation_rate(a, excitation, 0.015, 0.06) * (excitation - a)

        found = solve_ivp(rate, (0, 0.05), [start], rtol=1e-10, atol=1e-12)
        exact, errors = found.y[0, -1], []
        for steps in (25, 50):
            active = start
            for _ in range(steps):
                active = next_activation(active, excitation, 0.05 / steps, 0.015, 0.06)
            errors.append(abs(active - exact))
        assert errors[0] < 1e-3
        assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.6)  # second order
    assert next_activation(0.5, 3.0, 1e9, 0.015, 0.06) == 1.0  # clamped, and it never passes the excitation


@pytest.mark.ci
@pytest.mark.representatives("de-groote")
def test_isometric_contraction_is_the_reference_integration(muscle, reference):
    errors = {}
    # Millard's toe is so soft that the first milliseconds are stiff, which hides the order on fine steps
    coarse, fine = pair = (0.001, 0.0005) if muscle.curves == "millard" else (0.0002, 0.0001)
    for timestep in sorted({0.002, 0.001, *pair}, reverse=True):
        run = contract(muscle, HELD, 0.1, timestep=timestep)
        errors[timestep] = np.abs(run.force - reference(muscle, HELD, run.seconds)[1]).max() / 1000
    assert errors[0.002] < 4e-3  # of the greatest force
    assert errors[0.001] < 1e-3
    assert np.log2(errors[coarse] / errors[fine]) > 1.8  # second order
    # the muscle is held: what the fiber loses the tendon gains
    np.testing.assert_allclose(run.length, HELD)
    along = np.sqrt(run.fiber_length**2 - (0.1 * np.sin(0.3)) ** 2)
    np.testing.assert_allclose(along + run.tendon_length, HELD, atol=1e-12)
    assert run.fiber_length[-1] < run.fiber_length[0] - 0.005


@pytest.mark.ci
@pytest.mark.representatives("de-groote")
def test_quick_release_is_the_reference_integration(muscle, reference):
    errors = []
    for timestep in (0.002, 0.001, 0.0005):
        run = contract(muscle, HELD, 0.1, timestep=timestep, **RELEASE)
        length, force = reference(muscle, HELD, run.seconds, **RELEASE)
        errors.append((np.abs(run.length - length).max() * 1e3, np.abs(run.force - force).max() / 1000))
    assert errors[1][0] < 0.2  # mm, at 1 ms, of 30 mm
    assert errors[1][1] < 0.02  # of the greatest force
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (orders > 0.8).all(), orders  # MuJoCo's own integrator is of first order
    assert run.length[-1] < HELD - 0.005


def test_a_rigid_tendon_has_the_force_of_the_formula(muscle):
    hill, curves = dataclasses.replace(muscle, tendon="rigid"), bodies.hill_curves(muscle.curves)
    run = contract(hill, HELD, 0.05)
    np.testing.assert_allclose(run.tendon_length, 0.2)
    along = HELD - 0.2
    fiber = np.hypot(along, 0.1 * np.sin(0.3))
    np.testing.assert_allclose(run.fiber_length, fiber)
    inner = run.activation * curves.active_force_length(fiber / 0.1) + curves.passive_force_length(fiber / 0.1)
    np.testing.assert_allclose(run.force, 1000 * inner * along / fiber, rtol=1e-12)
    assert rigid_tension(1.0, 0.15, 0.0, 1000.0, 0.1, 0.2, 0.3, 10.0, 0.1) == 0.0  # a path shorter than the tendon


def test_a_stiff_tendon_is_nearly_rigid(muscle):
    stiff, rigid = (dataclasses.replace(muscle, tendon=kind) for kind in ("compliant", "rigid"))
    stiff = dataclasses.replace(stiff, tendon_slack_length=0.2, tendon_strain=0.0005)
    one, other = contract(stiff, HELD, 0.2), contract(rigid, HELD, 0.2)
    np.testing.assert_allclose(one.force, other.force, atol=25)


@pytest.mark.parametrize("activation", [0.0, *left_to_share(0.02, 0.5), 1.0])
@pytest.mark.parametrize("timestep", [*left_to_share(1e-4), 0.002, 0.02])
@pytest.mark.parametrize("length", [0.05, *left_to_share(0.25), 0.3, *left_to_share(0.36)])
def test_a_muscle_at_rest_stays_at_rest(muscle, activation, timestep, length):
    run = contract(muscle, length, 50 * timestep, activation, activation, timestep=timestep)
    np.testing.assert_allclose(run.force, run.force[0], rtol=1e-6, atol=1e-6)
    assert np.isfinite(run.fiber_length).all()


def test_a_slack_tendon_pulls_on_nothing(muscle):
    run = contract(muscle, 0.15, 0.3)
    assert (run.force == 0).all()
    assert (run.tendon_length < 0.2).all()
    assert (run.fiber_length >= 0.1 * 0.2).all()


@pytest.mark.ci
@pytest.mark.representatives("de-groote")
@pytest.mark.parametrize("curves", bodies.CURVES)
def test_any_numbers_stay_finite(curves):
    numbers = np.random.default_rng(0)
    for _ in range(60):
        hill = Hill(
            numbers.uniform(10, 5000),
            optimal := numbers.uniform(0.01, 0.3),
            numbers.uniform(0.01, 5) * optimal,
            numbers.uniform(0, 1.0),
            numbers.uniform(1, 20),
            fiber_damping=numbers.choice([0.0, 0.01, 0.1]),
            tendon_strain=numbers.uniform(0.01, 0.1),
            curves=curves,
        )
        path = hill.tendon_slack_length + optimal
        run = contract(hill, path * numbers.uniform(0.8, 1.2), 0.1, numbers.choice([0.0, 0.3, 1.0]), timestep=0.005)
        assert np.isfinite(np.array(run)).all()
        assert (run.force >= 0).all()


def test_states_are_those_of_fiber_and_activation():
    body = arm()
    batch = BodyBatch(body, seeds=2)
    state = batch.unpack(batch.packed)
    assert state.activation.shape == (2, 12)
    names, places = Anatomy(body).activations()
    assert (names[1], places.tolist()) == ("shoulder extensor", [1, 3, 5, 7, 9, 11])
    assert Anatomy(body).muscles.all()
    np.testing.assert_array_equal(Anatomy(body).control_range, np.tile((0.0, 1.0), (6, 1)))
    assert BodyBatch(arm(tendon="rigid"), 1).model.na == 6


@pytest.mark.ci
@pytest.mark.representatives("de-groote")
@pytest.mark.parametrize("curves", bodies.CURVES)
def test_a_reset_puts_fibers_in_balance(curves):
    batch = BodyBatch(arm(curves=curves), seeds=3)
    model, data = batch.model, mujoco.MjData(batch.model)
    positions = np.array([[0.2, 0.5], [1.0, 2.0], [0.6, 1.2]])
    activation = np.zeros((3, 12))
    activation[:, 1::2] = np.random.default_rng(0).uniform(0.1, 1, (3, 6))
    batch.reset([0, 1, 2], positions, activation=activation)
    states = batch.unpack(batch.packed.astype(float)).activation
    np.testing.assert_allclose(states[:, 1::2], activation[:, 1::2], rtol=1e-6)
    for row in range(3):
        data.qpos[:], data.act[:], data.ctrl[:] = positions[row], batch.snapshot()["state"][row][-12:], 0
        data.act[:] = states[row]
        data.ctrl[:] = states[row, 1::2]  # so that the activation stays
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.act_dot, 0, atol=2e-3)
    # a length that is given is kept
    activation[:, ::2] = 1.1
    batch.reset([0, 1, 2], positions, activation=activation)
    np.testing.assert_allclose(batch.unpack(batch.packed).activation[:, ::2], 1.1)


def test_plain_mujoco_begins_in_balance():
    """A state of 0, as MuJoCo sets it, stands for a fiber at rest."""
    body = arm()
    batch = BodyBatch(body, 1, substeps=1)
    data = mujoco.MjData(body.model)
    mujoco.mj_resetDataKeyframe(body.model, data, 0)
    mujoco.mj_forward(body.model, data)
    assert (data.actuator_force < 0).all()
    for _ in range(3):
        data.ctrl[:] = 0.5
        batch.step(np.full((1, 6), 0.5))
        mujoco.mj_step(body.model, data)
    np.testing.assert_allclose(data.act, batch.unpack(batch.packed).activation[0], rtol=1e-6)
    assert read_hill(body.model, data, 0).fiber_length > 0


@pytest.mark.ci
@pytest.mark.representatives("compliant-de-groote")
@pytest.mark.parametrize(
    ("tendon", "curves"), [("compliant", "de-groote"), ("rigid", "de-groote"), ("compliant", "millard")]
)
def test_results_depend_on_neither_threads_nor_restores(tendon, curves):
    body, actions = arm(tendon=tendon, curves=curves), np.random.default_rng(0).uniform(size=(30, 4, 6))
    packed = []
    for threads in (1, 3):
        batch = BodyBatch(body, 4, threads=threads)
        for action in actions[:15]:
            batch.step(action)
        other = BodyBatch(body, 4, threads=2)
        other.restore(batch.snapshot())
        for action in actions[15:]:
            batch.step(action)
            other.step(action)
        assert not batch.diverged.any()
        np.testing.assert_array_equal(batch.packed, other.packed)
        packed.append(batch.packed.copy())
    np.testing.assert_array_equal(*packed)
    single = BodyBatch(body, 1)
    for action in actions[:, 2:3]:
        single.step(action)
    np.testing.assert_array_equal(single.packed[0], packed[0][2])


def test_a_row_that_diverges_begins_again_and_disturbs_no_other():
    body, batches = arm(), []
    for value in (0.5, np.nan):
        batch = BodyBatch(body, 2)
        for step in range(5):
            action = np.full((2, 6), 0.5)
            if step == 2:
                action[0] = value
            batch.step(action)
        batches.append(batch)
    good, bad = batches
    assert bad.diverged.tolist() == [1, 0]
    np.testing.assert_array_equal(good.packed[1], bad.packed[1])
    assert np.isfinite(bad.packed).all()
    assert (bad.unpack(bad.packed).activation[0, ::2] > 0.2).all()


def test_export_simulates_identically():
    other = Hill(500.0, 0.2, 0.2, 0.2, tendon="rigid")  # curves may differ within a body
    body = arm(hill=(("biarticular*", other), ("elbow*", Hill(300.0, 0.1, 0.15, curves="millard"))))
    again = Mjcf(bodies.to_mjcf(body))
    one, other = BodyBatch(body, 1), BodyBatch(again, 1)
    for action in np.random.default_rng(1).uniform(size=(20, 1, 6)):
        one.step(action)
        other.step(action)
    np.testing.assert_array_equal(one.packed, other.packed)


@pytest.mark.ci
@pytest.mark.representatives("Euler", "RK4")
@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_every_integrator_is_stable(integrator):
    spec = arm().spec()
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    batch = BodyBatch(Mjcf(spec), 1)
    for action in np.random.default_rng(2).uniform(size=(50, 1, 6)).round():
        batch.step(action)
    assert not batch.diverged.any()
    fibers = batch.unpack(batch.packed).activation[0, ::2]
    assert (fibers > 0.2).all()
    assert (fibers < 2.0).all()


def test_numbers_are_those_of_the_model_or_those_given():
    native, given = Mjcf("arm6").model, Hill(300.0, 0.1, 0.15)
    body = arm(hill=(("elbow*", given),))
    assert build(Mjcf, table(body)) == body
    assert pickle.loads(pickle.dumps(body)) == body
    np.testing.assert_allclose(body.model.actuator_biasprm[2:4, :3], [[300.0, 0.1, 0.15]] * 2)
    # the elbow extensor leaves room for a tendon by MuJoCo's own rule, the shoulder flexor does not
    low, high = native.actuator_lengthrange[3]
    own = bodies.hill_of(native, 3)
    assert own.optimal_fiber_length == pytest.approx((high - low) / 0.3)
    assert own.tendon_slack_length == pytest.approx(low - 0.75 * (high - low) / 0.3)
    assert (own.max_contraction_velocity, own.activation_time_constant) == (1.5, 0.02)
    assert own.max_isometric_force == pytest.approx(400 / native.actuator_acc0[3])
    low, high = native.actuator_lengthrange[0]
    assert bodies.hill_of(native, 0).optimal_fiber_length == pytest.approx((high - low) / 1.1)


def test_keyframes_keep_the_states_of_other_actuators():
    spec = Mjcf("arm6").spec()
    lag = spec.add_actuator(name="lag", target="elbow", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    lag.dyntype, lag.gaintype, lag.biastype = mujoco.mjtDyn.mjDYN_FILTER, 0, 0
    spec.keys[0].act = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    body = Mjcf(spec, muscle_model="hill", hill=(("elbow flexor", dataclasses.replace(SOLEUS, tendon="rigid")),))
    np.testing.assert_allclose(body.model.key_act[0], [0, 0.1, 0, 0.2, 0.3, 0, 0.4, 0, 0.5, 0, 0.6, 0.7])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Hill(0.0, 0.1, 0.1), "max_isometric_force = 0.0: must be a finite number above 0, in N"),
        (lambda: Hill(1.0, 0.1, 0.0), r"tendon_slack_length = 0.0: must be at least 0.0001 m, or the tendon 'rigid'"),
        (lambda: Hill(1.0, 0.1, 0.1, 1.6), r"pennation_angle = 1.6: must be in \[0, 1.5708\), in rad"),
        (lambda: Hill(1.0, 0.1, 0.1, tendon="elastic"), "unknown tendon 'elastic'"),  # type: ignore[arg-type]
        (lambda: Hill(1.0, 0.1, 0.1, curves="thelen"), "unknown curves 'thelen'"),  # type: ignore[arg-type]
        (lambda: Hill(1.0, 0.1, 0.1, fiber_damping=-1), "fiber_damping = -1"),
        (lambda: arm(hill=(("wrist", SOLEUS),)), "unknown actuator in hill 'wrist'"),
        (lambda: Mjcf("arm6", hill=(("elbow*", SOLEUS),)), "muscle_model be 'hill'"),
        (lambda: Mjcf("<mujoco/>", muscle_model="hill"), "'native' for a model without muscles on tendons"),
        (lambda: HillMuscle("", "g", *ENDS, SOLEUS), "name = ''"),
        (lambda: HillMuscle("m", "g", *ENDS, 3.0), "hill = 3.0: must be a table of the settings of a Hill"),  # type: ignore[arg-type]
        (lambda: contract(SOLEUS, 0.3, 0.1, excitation=2.0), "excitation = 2.0: must be from 0 to 1"),
        (lambda: bodies.hill_of(arm().model, 0), "must be a muscle of MuJoCo"),
        (lambda: read_hill(Mjcf("arm6").model, None, 0), "must be a Hill-type muscle"),
    ],
)
def test_bad_numbers_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    "kind",
    [
        'biastype="user"',
        'dyntype="user"',
        'dyntype="user" biastype="user" actdim="3" biasprm="1 1 1 0 1"',
        'dyntype="user" biastype="user" actdim="2" biasprm="1 1 1 0 1 0 36 2"',
    ],
)
def test_user_actuators_that_are_no_hill_muscles_are_refused(kind):
    text = f"""<mujoco><worldbody><body><joint name="j" type="slide"/><geom size=".1"/></body></worldbody>
    <actuator><general name="own" joint="j" {kind}/></actuator></mujoco>"""
    with pytest.raises(ValueError, match="actuator = 'own': must be a Hill-type muscle"):
        Mjcf(text)


ENDS = Attachment("world", (0, 0, 0)), Attachment("world", (1, 0, 0))


def test_missing_and_foreign_callbacks_are_errors():
    model = arm().model
    batch = BodyBatch(arm(), 1)
    mujoco.set_mjcb_act_bias(None)
    with pytest.raises(RuntimeError, match=r"mjcb_act_bias = None.*would not pull.*install_muscle_callback"):
        bodies.check_muscle_callback(model)
    with pytest.raises(RuntimeError, match="mjcb_act_bias"):
        batch.step(np.ones((1, 6)))
    bodies.install_muscle_callback()
    mujoco.set_mjcb_act_dyn(lambda model, data, i: 0.0)
    with pytest.raises(RuntimeError, match=r"mjcb_act_dyn = .*not motorgrad's muscle law"):
        bodies.compile_model(arm())
    bodies.check_muscle_callback(bodies.compile_model(bodies.Hopper()))  # needs the gain alone
