"""Formulas: strings parsed into trees of numbers, names and known functions. Nothing in a string is executed.

condition  = both {"or" both};  both = inverse {"and" inverse};  inverse = {"not"} comparison
comparison = sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
sum        = term {("+" | "-") term};  term = factor {("*" | "/") factor}
factor     = {"-" | "+"} power;  power = atom ["^" factor]
atom       = number | name | function "(" condition {"," condition} ")" | "(" condition ")"
"""

import functools
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal, NamedTuple, get_args

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array

from motorgrad._errors import shown, unknown
from motorgrad.schema import MAX_SINGLE_PRECISION
from timlab.diagram import as_written


class Function(NamedTuple):
    """An elementwise function of numbers."""

    arguments: int
    apply: Callable[..., Any]
    condition: bool = False
    """Whether the result is true or false."""


def truth(value: ArrayLike) -> Array:
    """A number as a condition: true unless it is 0."""
    return jnp.asarray(value) != 0


FUNCTIONS: dict[str, Function] = {
    "abs": Function(1, jnp.abs),
    "sign": Function(1, jnp.sign),
    "sqrt": Function(1, jnp.sqrt),
    "exp": Function(1, jnp.exp),
    "log": Function(1, jnp.log),
    "log10": Function(1, jnp.log10),
    "sin": Function(1, jnp.sin),
    "cos": Function(1, jnp.cos),
    "tan": Function(1, jnp.tan),
    "asin": Function(1, jnp.arcsin),
    "acos": Function(1, jnp.arccos),
    "atan": Function(1, jnp.arctan),
    "sinh": Function(1, jnp.sinh),
    "cosh": Function(1, jnp.cosh),
    "tanh": Function(1, jnp.tanh),
    "sigmoid": Function(1, jax.nn.sigmoid),
    "floor": Function(1, jnp.floor),
    "ceil": Function(1, jnp.ceil),
    "round": Function(1, jnp.round),
    "atan2": Function(2, jnp.arctan2),
    "hypot": Function(2, jnp.hypot),
    "mod": Function(2, jnp.mod),
    "min": Function(2, jnp.minimum),
    "max": Function(2, jnp.maximum),
    "clip": Function(3, lambda u, low, high: jnp.minimum(jnp.maximum(u, low), high)),
    "if": Function(3, lambda condition, then, other: jnp.where(truth(condition), then, other)),
}
"""Functions that formulas may call. `round` rounds halves to the nearest even number; `mod` has the sign of the
divisor.
"""

OPERATORS: dict[str, Function] = {
    "+": Function(2, lambda a, b: a + b),
    "-": Function(2, lambda a, b: a - b),
    "*": Function(2, lambda a, b: a * b),
    "/": Function(2, lambda a, b: a / b),
    "^": Function(2, jnp.power),
    "<": Function(2, lambda a, b: a < b, True),
    "<=": Function(2, lambda a, b: a <= b, True),
    ">": Function(2, lambda a, b: a > b, True),
    ">=": Function(2, lambda a, b: a >= b, True),
    "==": Function(2, lambda a, b: a == b, True),
    "!=": Function(2, lambda a, b: a != b, True),
    "and": Function(2, lambda a, b: truth(a) & truth(b), True),
    "or": Function(2, lambda a, b: truth(a) | truth(b), True),
    "not": Function(1, lambda a: ~truth(a), True),
}
"""Infix and prefix operators."""
Comparison = Literal["<", "<=", ">", ">=", "==", "!="]
COMPARISONS = get_args(Comparison)


MAX_FORMULA_CHARACTERS = 1000
NESTED = 30  # nested brackets, signs and powers
MAX_NESTED_OPERATORS = 100  # as in a long sum
CONSTANTS = {"pi": 3.141592653589793}
LOGICAL_OPERATORS = {"and", "or", "not"}
JUMPING = {"<", "<=", ">", ">=", "floor", "ceil", "round", "sign", "mod"}
RESERVED = {*FUNCTIONS, *CONSTANTS, *LOGICAL_OPERATORS}
"""Names that have a meaning in every formula."""

_SAME = str.maketrans({"−": "-", "·": "*", "×": "*", "÷": "/"})
_TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[^\W\d]\w*)|(?P<sign><=|>=|==|!=|[-+*/^<>(),])"
)


class Tree(NamedTuple):
    """A formula: a `number`, a `name`, or the function `name` of `parts`. `column` is its position in the text,
    from 1.
    """

    column: int
    name: str = ""
    number: float = 0.0
    parts: tuple["Tree", ...] = ()
    depth: int = 1

    def of(self, *parts: "Tree") -> "Tree":
        """This node as a function of parts."""
        depth = 1 + max(part.depth for part in parts)
        if depth > MAX_NESTED_OPERATORS:
            raise FormulaError(self.column, f"more than {MAX_NESTED_OPERATORS} nested operators; use brackets")
        return self._replace(parts=parts, depth=depth)


class Token(NamedTuple):
    kind: str
    text: str
    column: int


class FormulaError(ValueError):
    """An error in a formula, at a column from 1."""

    def __init__(self, column: int, message: str):
        super().__init__(f"column {column}: {message}")


def formula(name: str, text: object, known: Iterable[str]) -> Tree:
    """Parse a formula that may use the names `known`.

    **Raises** `ValueError` that names the setting `name`, the column and the error.
    """
    try:
        if not isinstance(text, str):
            raise FormulaError(1, "must be a string")
        tree = parsed(text)
        for part in _name_nodes(tree):
            if part.name not in {*known, *CONSTANTS}:
                raise FormulaError(part.column, str(unknown("name", part.name, known)))
        return tree
    except FormulaError as error:
        raise ValueError(f"{name} = {shown(text)}: {error}") from None


@functools.lru_cache(maxsize=1024)
def parsed(text: str) -> Tree:
    """The tree of a formula. **Raises** `FormulaError`."""
    if len(text) > MAX_FORMULA_CHARACTERS:
        raise FormulaError(MAX_FORMULA_CHARACTERS + 1, f"longer than {MAX_FORMULA_CHARACTERS} characters")
    reader = _Reader(_tokens(text.translate(_SAME)))
    tree = reader.condition()
    if reader.next.kind != "end":
        raise reader.unexpected("an operator or the end")
    return tree


def names_read(tree: Tree) -> set[str]:
    """The names that a formula reads."""
    return {part.name for part in _name_nodes(tree)} - set(CONSTANTS)


def is_condition(tree: Tree) -> bool:
    """Whether a formula is a condition."""
    return tree.name in OPERATORS and OPERATORS[tree.name].condition


def evaluate(
    tree: Tree, values: Mapping[str, Any], beside: Mapping[str, Any] | None = None, compared: jnp.dtype | None = None
) -> Any:
    """The value of a formula for these values of names, element by element; 1 or 0 for a condition.

    The parts that may jump, and read no other names than those in `beside`, are evaluated for its values; others
    compare numbers rounded to the dtype `compared`.
    """
    if beside is not None and tree.name in JUMPING and names_read(tree) <= set(beside):
        return evaluate(tree, beside)
    if not tree.parts:
        given = values[tree.name] if tree.name in values else CONSTANTS.get(tree.name, tree.number)
        return jnp.asarray(given, float)
    parts = [evaluate(part, values, beside, compared) for part in tree.parts]
    if compared is not None and tree.name in COMPARISONS:
        parts = [part.astype(compared) for part in parts]
    if tree.name == "^" and not tree.parts[1].name:
        power = tree.parts[1].number
        if power.is_integer() and abs(power) <= 64:  # exact, and correct for negative bases
            return jnp.power(parts[0], int(power))
    function = OPERATORS.get(tree.name) or FUNCTIONS[tree.name]
    return jnp.asarray(function.apply(*parts), float)


def evaluate_at(
    tree: Tree, times: Mapping[str, tuple[Any, Any]], constants: Mapping[str, Any], inputs: Mapping[str, Any]
) -> Any:
    """The value of a formula at a moment, in the precision of signals; in double precision on the way if it reads one
    of the `times`, in seconds: each the time itself, and the time at which what jumps in time alone is evaluated.

    A constant or an input hides a time of its name, and an input a constant.
    """
    hidden = {*constants, *inputs}
    if not names_read(tree) & (set(times) - hidden):
        return evaluate(tree, {**constants, **inputs})
    real = jnp.result_type(float)
    with jax.enable_x64(True):
        known = {name: as_written(value) for name, value in constants.items()}
        given = {name: jnp.asarray(value).astype(jnp.float64) for name, value in inputs.items()}
        values, beside = ({name: each[n] for name, each in times.items()} | known for n in (0, 1))
        beside = {name: value for name, value in beside.items() if name not in inputs}
        return evaluate(tree, values | given, beside, real).astype(real)


def _name_nodes(tree: Tree) -> Iterable[Tree]:
    if tree.name and not tree.parts:
        yield tree
    for part in tree.parts:
        yield from _name_nodes(part)


def _tokens(text: str) -> list[Token]:
    tokens = []
    place = 0
    while (place := len(text) - len(text[place:].lstrip())) < len(text):
        found = _TOKEN.match(text, place)
        if found is None:
            raise FormulaError(place + 1, f"{text[place]!r} is not allowed")
        kind = str(found.lastgroup)
        word = found.group()
        if kind == "number" and float(word) > MAX_SINGLE_PRECISION:
            said = word if len(word) < 50 else shown(word)
            raise FormulaError(place + 1, f"{said} is too large for single precision")
        tokens.append(Token("sign" if word in LOGICAL_OPERATORS else kind, word, place + 1))
        place = found.end()
    return [*tokens, Token("end", "", len(text) + 1)]


class _Reader:
    """A recursive-descent parser; each method parses the rule of the grammar with its name."""

    def __init__(self, tokens: list[Token]):
        self.tokens = tokens
        self.place = 0
        self.depth = 0

    @property
    def next(self) -> Token:
        return self.tokens[self.place]

    def accept(self, *signs: str) -> Token | None:
        """The next token, consumed if it is one of these signs."""
        token = self.next
        if token.kind != "sign" or token.text not in signs:
            return None
        self.place += 1
        return token

    def unexpected(self, wanted: str) -> FormulaError:
        found = shown(self.next.text) if self.next.text else "the end"
        hint = (
            "; powers are written with ^" if self.next.text == "*" and self.tokens[self.place - 1].text == "*" else ""
        )
        hint = hint or ("; combine comparisons with 'and'" if self.next.text in COMPARISONS else "")
        return FormulaError(self.next.column, f"expected {wanted}, not {found}{hint}")

    def nest(self, token: Token) -> None:
        self.depth += 1
        if self.depth > NESTED:
            raise FormulaError(token.column, f"nested deeper than {NESTED}")

    def chain(self, part: Callable[[], Tree], *signs: str) -> Tree:
        """Parts between signs, left-associative."""
        tree = part()
        while token := self.accept(*signs):
            tree = Tree(token.column, token.text).of(tree, part())
        return tree

    def condition(self) -> Tree:
        return self.chain(self.both, "or")

    def both(self) -> Tree:
        return self.chain(self.inverse, "and")

    def inverse(self) -> Tree:
        if token := self.accept("not"):
            self.nest(token)
            tree = Tree(token.column, "not").of(self.inverse())
            self.depth -= 1
            return tree
        return self.comparison()

    def comparison(self) -> Tree:
        tree = self.sum()
        if token := self.accept(*COMPARISONS):
            tree = Tree(token.column, token.text).of(tree, self.sum())
        return tree

    def sum(self) -> Tree:
        return self.chain(self.term, "+", "-")

    def term(self) -> Tree:
        return self.chain(self.factor, "*", "/")

    def factor(self) -> Tree:
        if token := self.accept("-", "+"):
            self.nest(token)
            inner = self.factor()
            self.depth -= 1
            if token.text == "+":
                return inner
            if not inner.name:  # a number
                return Tree(token.column, number=-inner.number)
            return Tree(token.column, "-").of(Tree(token.column), inner)
        return self.power()

    def power(self) -> Tree:
        base = self.atom()
        if token := self.accept("^"):
            self.nest(token)
            base = Tree(token.column, "^").of(base, self.factor())
            self.depth -= 1
        return base

    def atom(self) -> Tree:
        token = self.next
        if self.accept("("):
            return self.bracket(token)[0]
        if token.kind not in ("number", "name"):
            raise self.unexpected("a number, a name or a bracket")
        self.place += 1
        if token.kind == "number":
            return Tree(token.column, number=float(token.text))
        if not self.accept("("):
            if token.text in FUNCTIONS:
                raise FormulaError(token.column, f"{token.text} is a function: expected '(' after it")
            return Tree(token.column, token.text)
        if token.text not in FUNCTIONS:
            raise FormulaError(token.column, str(unknown("function", token.text, FUNCTIONS)))
        parts = self.bracket(token, list=True)
        wanted = FUNCTIONS[token.text].arguments
        if len(parts) != wanted:
            plural = "argument" if wanted == 1 else "arguments"
            raise FormulaError(token.column, f"{token.text} takes {wanted} {plural}, not {len(parts)}")
        return Tree(token.column, token.text).of(*parts)

    def bracket(self, token: Token, list: bool = False) -> list[Tree]:
        """The contents of brackets, after the opening one."""
        self.nest(token)
        parts = [self.condition()]
        while list and self.accept(","):
            parts.append(self.condition())
        if not self.accept(")"):
            raise self.unexpected("',' or ')'" if list else "')'")
        self.depth -= 1
        return parts
