"""Formulas: what they mean, what they refuse, and that nothing in them is executed."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from block_driver import alone, drive, of
from hypothesis import given, settings
from hypothesis import strategies as st

from timlab.blocks._formulas import FUNCTIONS, MAX_FORMULA_CHARACTERS, evaluate, formula, is_condition, parsed

VALUES = {"a": 2.0, "b": -3.0, "c": 0.5}


def value(text, **values):
    return float(evaluate(formula("expression", text, {**VALUES, **values}), {**VALUES, **values}))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + 2*3", 7),
        ("10 - 3 - 2", 5),
        ("12/3/2", 2),
        ("-2^2", -4),
        ("(-2)^2", 4),
        ("b^3", -27),
        ("2^3^2", 512),
        ("2^-1", 0.5),
        ("a^c", math.sqrt(2)),
        ("--a", 2),
        ("+a - -b", -1),
        ("3e-1 + .5 + 2.", 2.8),
        ("2 · a × 3 ÷ 4 − 1", 2),
        ("pi", math.pi),
        ("a < b", 0),
        ("a >= 2 and not b > 0", 1),
        ("a == 2 or 1/0 > 0", 1),
        ("not a", 0),
        ("not not (a != b)", 1),
        ("(a > 1) + (b < 0)", 2),
        ("(a > 1) - (b < 0)", 0),
        ("(a > 1)^2", 1),
        ("if(a > b, 10, 20)", 10),
        ("if(b, 10, 20)", 10),
        ("max(a, min(b, c))", 2),
        ("clip(b, -1, 1)", -1),
        ("atan2(1, -1)", 0.75 * math.pi),
        ("mod(b, 2)", 1),
        ("sign(b)*abs(b)", -3),
        ("round(2.5) + floor(-.5) + ceil(.5)", 2),
        ("exp(log(7)) + sqrt(hypot(3, 4) + 4) + log10(100)", 12),
        ("sigmoid(0) + tanh(0) + cosh(0) + sinh(0)", 1.5),
        ("sin(1)^2 + cos(1)^2 + tan(0) + asin(0) + acos(1) + atan(0)", 1),
    ],
)
def test_means_what_mathematics_means(text, expected):
    assert value(text) == pytest.approx(expected, abs=2e-6)


def test_every_function_is_tried_above():
    tried = " ".join(str(case.args) for case in test_means_what_mathematics_means.pytestmark)
    assert [name for name in FUNCTIONS if f"{name}(" not in tried] == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "column 1: expected a number, a name or a bracket, not the end"),
        ("a +", "column 4: .* not the end"),
        ("a * / b", "column 5: .* not '/'"),
        ("a ** 2", "column 4: .*; powers are written with \\^"),
        ("1 < a < 3", "column 7: .*; combine comparisons with 'and'"),
        ("a b", "column 3: expected an operator or the end, not 'b'"),
        ("(a + b", "column 7: expected '\\)', not the end"),
        ("a + q", "column 5: unknown name 'q': .*known are a, b, c"),
        ("sinn(a)", "column 1: unknown function 'sinn': did you mean 'sin'"),
        ("sin", "column 1: sin is a function: expected '\\('"),
        ("max(a)", "column 1: max takes 2 arguments, not 1"),
        ("sin(a, b)", "column 1: sin takes 1 argument, not 2"),
        ("a & b", "column 3: '&' is not allowed"),
        ("a = 1", "column 3: '=' is not allowed"),
        ("a.b", "column 2: '.' is not allowed"),
        ("1e99", "column 1: 1e99 is too large"),
        ("__import__('os')", 'column 12: "\'" is not allowed'),
        ("__import__(a)", "column 1: unknown function '__import__'"),
        ("(" * 31 + "a" + ")" * 31, "column 31: nested deeper than 30"),
        ("-" * 31 + "a", "column 31: nested deeper than 30"),
        ("a" + "+a" * 200, "more than 100 nested operators"),
        (
            "a" * (MAX_FORMULA_CHARACTERS + 1),
            f"column {MAX_FORMULA_CHARACTERS + 1}: longer than {MAX_FORMULA_CHARACTERS} characters",
        ),
        (None, "column 1: must be a string"),
        ("a\nb", "column 3: expected an operator"),
    ],
)
def test_refuses_with_the_column(text, message):
    with pytest.raises(ValueError, match=message) as error:
        formula("expression", text, VALUES)
    assert str(error.value).startswith("expression = ")
    assert "\n" not in str(error.value)


TEXTS = st.text(st.sampled_from("ab1.0+-*/^<>=!(), notrdsiex_·\n\\'\"[]{}é"), max_size=60)


def see_that_it_is_a_formula_or_refused(text):
    message, tree = "", parsed("0")
    try:
        tree = formula("expression", text, VALUES)
    except ValueError as error:  # any other kind of exception fails the test
        message = str(error)
    assert "\n" not in message
    assert evaluate(tree, VALUES).shape == ()


@given(TEXTS)
@settings(max_examples=500, deadline=None)
def test_any_text_is_a_formula_or_refused_in_one_line(text):
    see_that_it_is_a_formula_or_refused(text)


@pytest.mark.ci
@given(TEXTS)
@settings(max_examples=1500, deadline=None)
def test_any_of_many_texts_is_a_formula_or_refused_in_one_line(text):
    see_that_it_is_a_formula_or_refused(text)


NUMBERS = st.floats(0.1, 3).map(lambda x: f"{x:.3f}") | st.sampled_from(["a", "b"])
TREES = st.recursive(
    NUMBERS,
    lambda inner: (
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})")
        | inner.map(lambda text: f"-{text}")
        | inner.map(lambda text: f"max({text}, 1)")
    ),
    max_leaves=12,
)


@given(TREES)
@settings(max_examples=150, deadline=None)
def test_arithmetic_is_that_of_python(text):
    try:
        expected = eval(text, {"a": 2.0, "b": -3.0, "max": max})  # a text of our own making
    except ZeroDivisionError:
        return
    with jax.enable_x64(True):
        assert value(text) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_the_longest_allowed_formulas_can_be_evaluated():
    assert value("a" + "+a" * 99) == 200
    assert value("(" * 30 + "a" + ")" * 30) == 2
    assert value("if(a, " * 30 + "a" + ", 0)" * 30) == 2


def test_knows_conditions():
    assert is_condition(parsed("a < b"))
    assert is_condition(parsed("(not a)"))
    assert not is_condition(parsed("abs(a)"))


def test_expression_block_gives_numbers_and_conditions():
    x, y = np.linspace(-1, 1, 12).reshape(6, 2), np.ones((6, 2))
    block = of("expression", "k*x^2 + y", ("x", "y"), ("k",), 3.0, shape=(2,))
    np.testing.assert_allclose(drive(block, 6, x=x, y=y)["y"], 3 * x**2 + 1, rtol=1e-6)
    condition = of("expression", "x > limit", ("x",), ("limit",), (0.1,), shape=(2,))
    assert condition.outputs["y"].kind == "bool"
    np.testing.assert_array_equal(drive(condition, 6, x=x)["y"], x > 0.1)


def test_expression_of_time_moves_within_a_tick():
    block = of("expression", "t^2", reads=())
    assert block.timing == "continuous"
    assert of("expression", "t^2", reads=("t",)).timing == "inherited"
    np.testing.assert_allclose(alone(block, 20, 0.1)[0], (np.arange(20) * 0.1) ** 2, atol=1e-5)


def test_expression_names_are_checked():
    for arguments, message in (
        (("u", ("u", "u")), "reads = .*: must be distinct names; repeated are 'u'"),
        (("u", ("sin",)), "reads\\[0\\] = 'sin': must be another name"),
        (("u", ("2u",)), "reads\\[0\\] = '2u': must be 1 to 40 letters"),
        (("u", ("u",), ("u",)), "constants\\[0\\] = 'u': must be another name"),
        (("u", ("u",), ("k",), (1.0, 2.0)), "numbers: shape = \\(2,\\)"),
        (("u", "u"), "reads = 'u': must be a list"),
    ):
        with pytest.raises(ValueError, match=message):
            of("expression", *arguments)


@pytest.mark.parametrize("name", ["sqrt", "tanh", "round"])
def test_function_block(name):
    u = np.linspace(0.1, 3, 9)
    given = drive(of("function", name), 9, u=u)["y"]
    np.testing.assert_allclose(given, getattr(np, name)(u.astype(np.float32)), rtol=1e-6)


def test_gradients_pass():
    tree = formula("expression", "sin(a)*a^3 + if(a > 1, a, 0)", {"a"})
    slope = jax.grad(lambda a: evaluate(tree, {"a": a}))(jnp.asarray(2.0))
    assert float(slope) == pytest.approx(math.cos(2) * 8 + 3 * 4 * math.sin(2) + 1, rel=1e-5)
