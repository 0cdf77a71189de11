"""Numbers of a model are held against what they mean: where MuJoCo would compute something else, or nonsense, in
silence, the part and the number are named.
"""

import re
import warnings

import mujoco
import numpy as np
import pytest

from motorgrad.bodies import Anatomy, BodyBatch, Hopper, Mjcf, compile_model, hill_of, read_model, to_mjcf

WORLD = """<worldbody><body name="b"><joint name="j" type="slide" axis="0 0 1" {joint}/>
<geom name="g" size=".1" {geom}/><site name="s"/></body><site name="o" pos="0 0 2"/></worldbody>
<tendon><spatial name="t" {tendon}><site site="s"/><site site="o"/></spatial></tendon>"""
MUSCLE = '<muscle name="m" tendon="t" force="100" lengthrange=".5 2.5" {}/>'
OWN = """<general name="m" tendon="t" lengthrange=".5 2.5" dyntype="muscle" gaintype="muscle" biastype="muscle"
dynprm=".01 .04" gainprm="{0} 100 200 .5 1.6 1.5 1.3 1.2" biasprm="{0} 100 200 .5 1.6 1.5 1.3 1.2" {1}/>"""
FAR = "1e+10 in size"


def mjcf(actuator="", sensor="", option="", key="", **parts):
    world = WORLD.format(**{part: parts.get(part, "") for part in ("joint", "geom", "tendon")})
    key = f'<key name="k" {key}/>' if key else ""
    return (
        f"<mujoco><option {option}/>{world}<actuator>{actuator}</actuator><sensor>{sensor}</sensor>"
        f"<keyframe>{key}</keyframe></mujoco>"
    )


def general(given):
    return mjcf(f'<general name="a" joint="j" {given}/>')


def sensor(given):
    return mjcf(sensor=f'<jointpos name="p" joint="j" {given}/>')


REFUSED = {  # what is told: the document
    # what only another program knows
    "actuator = 'a': must be a muscle, as `add_muscles` makes it": general('gaintype="user"'),
    "actuator = 'on a path': must be a muscle": mjcf(
        '<general name="on a path" tendon="t" gaintype="user" gainprm="5 2 1"/>'
    ),
    "actuator = 'doubled': must be a muscle": mjcf(
        '<general name="doubled" tendon="t" gaintype="user" gainprm="-5 2 1" gear="2"/>'
    ),
    "actuator = 'a': must be a Hill-type muscle": general('dyntype="user" actdim="1"'),
    "actuator = 'on a joint': must be a Hill-type muscle": mjcf(
        '<general name="on a joint" joint="j" dyntype="user" actdim="2" biastype="user" gainprm="0" '
        'dynprm=".01 .04" biasprm="1 1 1 .1 10 .1 30"/>'
    ),
    "sensor = 'u': must be of another type": mjcf(sensor='<user name="u" dim="3"/>'),
    # muscles
    "<muscle> in line 4: range = '-0.5 -0.1': must be at least 0": mjcf("\n" + MUSCLE.format('range="-0.5 -0.1"')),
    "<muscle> in line 4: timeconst = '-1 .04': must be at": mjcf("\n" + MUSCLE.format('timeconst="-1 .04"')),
    "range of actuator 'm' = [-0.5, -0.1]: must be lengths": mjcf(OWN.format("-.5 -.1", "")),
    "lengthrange of actuator 'm' = [-2.0, -1.0]": mjcf(MUSCLE.format("").replace(".5 2.5", "-2 -1")),
    "time constant of activation of actuator 'm' = 0.0": mjcf(MUSCLE.format('timeconst="0 .04"')),
    "ctrlrange of actuator 'm' = [0.0, inf]": mjcf(MUSCLE.format('ctrllimited="true" ctrlrange="0 inf"')),
    # other actuators
    "time constant of deactivation of actuator 'a' = 0.0": general('dyntype="muscle"'),
    "time constant of actuator 'a' = 0.0": general('dyntype="filter" dynprm="0"'),
    "time constant of actuator 'a' = -1.0": general('dyntype="filterexact" dynprm="-1"'),
    "gainprm of actuator 'a' = [inf,": general('gainprm="inf"'),
    "<general> in line 3: gainprm = 'nan': must be a number": general('gainprm="nan"'),
    "delay of actuator 'a' = 0.1: must be at most 0.004 s, as nsample is 2": general('delay=".1" nsample="2"'),
    # joints, geoms, tendons
    "range of joint 'j' = [-inf, inf]": mjcf(joint='range="-inf inf" limited="true"'),
    "damping of joint 'j' = -1.0": mjcf(joint='damping="-1"'),
    "armature of joint 'j' = -1.0": mjcf(joint='armature="-1"'),
    "frictionloss of joint 'j' = -1.0": mjcf(joint='frictionloss="-1"'),
    "ref of joint 'j' = inf": mjcf(joint='ref="inf"'),
    "<joint> in line 1: damping = 'NaN': must be a number": mjcf(joint='damping="NaN"'),
    "<geom> in line 2: mass = 'nan': must be a number": mjcf(geom='mass="nan"'),
    "of body 'b' = [inf, inf, inf]: must be finite": mjcf(geom='mass="inf"'),
    "friction of geom 'g' = [-1.0, 0.005, 0.0001]": mjcf(geom='friction="-1"'),
    "damping of tendon 't' = -1.0": mjcf(tendon='damping="-1"'),
    # options
    "option: timestep = 0.0: must be a finite number > 0": mjcf(option='timestep="0"'),
    "option: timestep = -1.0": mjcf(option='timestep="-1"'),
    "option: gravity = [0.0, 0.0, inf]": mjcf(option='gravity="0 0 inf"'),
    "option: viscosity = -1.0": mjcf(option='viscosity="-1"'),
    # keyframes
    f"qpos of keyframe 'k' = [1000000000000.0]: must be at most {FAR}": mjcf(key='qpos="1e12"'),
    "qvel of keyframe 'k' = [inf]": mjcf(key='qvel="inf"'),
    "activation of actuator 'm' in keyframe 'k' = [7.0]: must be from 0 to 1": mjcf(MUSCLE.format(""), key='act="7"'),
    "activation of actuator 'a' in keyframe 'k' = [0.5]: must be from -0.2 to 0.2": mjcf(
        '<general name="a" joint="j" dyntype="integrator" actlimited="true" actrange="-.2 .2"/>', key='act=".5"'
    ),
    # sensors
    "cutoff of sensor 'p' = inf": sensor('cutoff="inf"'),
    "delay of sensor 'p' = 1.0: must be at most 0.006 s, as nsample is 3": sensor('delay="1" nsample="3"'),
    "interval of sensor 'p' = 0.5: must be left out, or nsample given": sensor('interval=".5"'),
}


@pytest.mark.parametrize("told", REFUSED)
def test_a_number_without_a_meaning_is_refused_by_name(told):
    with pytest.raises(ValueError, match=re.escape(told)):
        read_model(REFUSED[told])


@pytest.mark.parametrize(
    "text",
    [
        mjcf(OWN.format("0 1", ""), key='act="1"'),
        mjcf(MUSCLE.format('force="-1" scale="300"').replace('force="100"', "")),
        mjcf(tendon='range="1 inf" limited="true"', joint='stiffness="-1"'),
        mjcf('<general name="nan" joint="j" forcelimited="true" forcerange="-inf 3"/>'),
        general('dyntype="filterexact" dynprm="0" delay=".004" nsample="2"'),
        sensor('delay=".2" interval=".1" nsample="2" cutoff=".3"'),
        mjcf('<position name="a" joint="j" kp="3"/>', geom='user="nan"'),
    ],
)
def test_what_has_a_meaning_is_read(text):
    assert read_model(text).nv == 1


@pytest.mark.parametrize("muscle_model", ["thesis", "native"])
def test_muscles_of_this_library_are_read_from_a_file_as_they_are(muscle_model):
    body = Hopper(muscle_model=muscle_model)
    np.testing.assert_array_equal(read_model(to_mjcf(body)).actuator_gainprm, compile_model(body).actuator_gainprm)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (general('dyntype="filter" dynprm=".001"'), "actuator 'a': .*time step of 0.002 s; use a timestep of at most"),
        (mjcf(MUSCLE.format('timeconst=".003 .04"')), "actuator 'm': .*use a timestep of at most 0.0015 s"),
        (sensor('noise=".1"'), "noise of sensor 'p': it has no effect"),
    ],
)
def test_what_will_not_do_what_it_says_is_warned_of(text, told):
    with pytest.warns(UserWarning, match=told):
        read_model(text)


def test_an_activation_stays_within_its_limits_at_the_time_step_that_is_advised():
    """What the warning is about, in MuJoCo: at an activation of 0 the time constant is half of what is given."""
    reached = {}
    for step in (0.0015, 0.0024):
        model = mujoco.MjModel.from_xml_string(mjcf(MUSCLE.format('timeconst=".003 .04"'), option=f'timestep="{step}"'))
        data = mujoco.MjData(model)
        data.ctrl[:] = 1.0
        mujoco.mj_step(model, data)
        reached[step] = data.act[0]
    assert reached[0.0015] == pytest.approx(1.0)
    assert reached[0.0024] == pytest.approx(1.6)


def test_a_delay_that_is_allowed_is_kept():
    """A body that falls freely for 0.1 s, and a sensor that lags by 0.02 s."""
    model = read_model(sensor('delay=".02" nsample="10"'))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 50)
    mujoco.mj_forward(model, data)
    fallen = -0.5 * 9.81 * (data.time - 0.02) ** 2
    assert data.sensordata[0] == pytest.approx(fallen, rel=0.05)


def test_a_muscle_is_told_from_its_gain_its_bias_and_its_dynamics():
    model = read_model(mjcf(OWN.format(".75 1.05", "").replace('dyntype="muscle"', "")))
    with pytest.raises(ValueError, match="actuator = 'm': must be a muscle of MuJoCo, with dynamics, gain and bias"):
        hill_of(model, 0)


def test_a_muscle_that_no_hill_muscle_resembles_is_named():
    with pytest.raises(ValueError, match=r"muscle 'm': max_isometric_force = 0.0: must be .*; give its numbers by"):
        Mjcf(mjcf(MUSCLE.format("").replace("100", "0").replace(".5 2.5", "1.5 2.5")), muscle_model="hill")
    with pytest.raises(ValueError, match=r"muscle 'm': path = 0.1 to 2.5 m: must be less variable"):
        Mjcf(mjcf(MUSCLE.format("").replace(".5 2.5", ".1 2.5")), muscle_model="hill")


def test_smoothing_that_no_hill_muscle_has_is_warned_of():
    model = read_model(mjcf(MUSCLE.format('tausmooth=".1"').replace(".5 2.5", "1.5 2.5")))
    with pytest.warns(UserWarning, match="tausmooth of the muscle 'm' = 0.1: a Hill-type muscle has none"):
        hill_of(model, 0)


def test_limits_of_an_activation_do_not_hold_the_fiber_of_a_hill_muscle():
    text = mjcf(OWN.format(".75 1.05", 'actlimited="true" actrange="0 1"').replace(".5 2.5", "1.5 2.5"))
    body = Mjcf(text, muscle_model="hill")
    batch = BodyBatch(body, 1, substeps=50)
    batch.reset([0], position=[[-0.4]])
    assert batch.unpack(batch.packed).activation[0, 0] > 1.0
    assert not body.model.actuator_actlimited.any()


def test_excitations_of_muscles_are_those_that_mujoco_takes():
    body = Mjcf(mjcf(MUSCLE.format('ctrllimited="true" ctrlrange="-1 .5"') + '<motor joint="j"/>'))
    np.testing.assert_array_equal(Anatomy(body).control_range, [(0, 0.5), (-1, 1)])
    batch, twin = BodyBatch(body, 1), BodyBatch(body, 1)
    batch.step([[-1.0, 0.0]])
    twin.step([[0.0, 0.0]])
    np.testing.assert_array_equal(batch.packed, twin.packed)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e12])
@pytest.mark.parametrize(("name", "field"), [("position", "qpos"), ("velocity", "qvel"), ("activation", "act")])
def test_a_start_that_is_not_finite_is_refused_and_changes_nothing(wrong, name, field):
    batch = BodyBatch(Mjcf(mjcf(MUSCLE.format(""))), 2)
    before = batch.packed.copy()
    with pytest.raises(ValueError, match=rf"{field} = \[{re.escape(str(wrong))}\]: must be finite and at most 1e\+10"):
        batch.reset([1], **{name: [[wrong]]})
    np.testing.assert_array_equal(batch.packed, before)
    batch.reset([1], position=[[0.1]])


def test_models_of_the_library_are_read_without_a_word():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Mjcf("arm6").model.nu == Mjcf("arm6", muscle_model="hill").model.nu == 6


def branching(count):
    """Bodies with four legs of two joints each, which touch each other."""
    leg = (
        '<body pos="{0} 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 {0} -.05" size=".04"/>'
        '<body pos="{0} -.05"><joint axis="1 0 0"/><geom type="capsule" fromto="0 0 0 {0} -.05" size=".04"/>'
        "</body></body>"
    )
    legs = "".join(map(leg.format, (".2 0", "0 .2", "-.2 0", "0 -.2")))
    body = f'<body pos="0 0 .3"><freejoint/><geom type="box" size=".1 .1 .1"/>{legs}</body>'
    return f'<mujoco><worldbody><replicate count="{count}" offset=".07 .03 .1">{body}</replicate></worldbody></mujoco>'


def test_wrong_accelerations_of_sparse_models_are_warned_of():
    """MuJoCo 4.0.0 has a fault there, which 4.0.1 has not; the dense matrices are right in both."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        sparse = read_model(branching(8))
        dense = read_model(branching(8).replace("<mujoco>", '<mujoco><option jacobian="dense"/>'))
    assert mujoco.mj_isSparse(sparse)
    data, other, errors = mujoco.MjData(dense), mujoco.MjData(sparse), []
    for _ in range(20):
        other.qpos[:], other.qvel[:], other.qacc_warmstart[:] = data.qpos, data.qvel, data.qacc_warmstart
        mujoco.mj_step(dense, data)
        mujoco.mj_forward(sparse, other)
        errors.append(np.abs(other.qacc - data.qacc).max() / np.abs(data.qacc).max())
    wrong = bool(max(errors) > 0.01)
    assert [str(each.message)[:12] for each in told] == ["MuJoCo 4.0.0"] * wrong
