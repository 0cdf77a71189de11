"""Formulas as text: parsed into a tree of numbers, names and known functions. Nothing in a text is ever executed.

condition  = both {"or" both};  both = inverse {"and" inverse};  inverse = {"not"} comparison
comparison = sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
sum        = term {("+" | "-") term};  term = factor {("*" | "/") factor}
factor     = {"-" | "+"} power;  power = atom ["^" factor]
atom       = number | name | function "(" condition {"," condition} ")" | "(" condition ")"
"""

import functools
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp

from motorgrad._errors import shown, unknown
from motorgrad.lab.blocks._functions import COMPARISONS, FUNCTIONS, OPERATORS

LONGEST = 1000  # characters of a text
NESTED = 30  # brackets, signs and powers within each other
DEEPEST = 100  # operators on operators, as in a long sum
LARGEST = 3.4e38  # of single precision
CONSTANTS = {"pi": 3.141592653589793}
WORDS = {"and", "or", "not"}
RESERVED = {*FUNCTIONS, *CONSTANTS, *WORDS}
"""Names that mean something in every formula."""

_SAME = str.maketrans({"−": "-", "·": "*", "×": "*", "÷": "/"})
_TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[^\W\d]\w*)|(?P<sign><=|>=|==|!=|[-+*/^<>(),])"
)


class Tree(NamedTuple):
    """A formula: a `number`, a `name`, or a function (the `name`) of `parts`; `column` is where it stands, from 1."""

    column: int
    name: str = ""
    number: float = 0.0
    parts: tuple["Tree", ...] = ()
    depth: int = 1

    def of(self, *parts: "Tree") -> "Tree":
        """This as a function of parts."""
        depth = 1 + max(part.depth for part in parts)
        if depth > DEEPEST:
            raise FormulaError(self.column, f"more than {DEEPEST} operators on each other; use brackets")
        return self._replace(parts=parts, depth=depth)


class Token(NamedTuple):
    kind: str
    text: str
    column: int


class FormulaError(ValueError):
    """Something wrong in a formula, at a column from 1."""

    def __init__(self, column: int, message: str):
        super().__init__(f"column {column}: {message}")


def formula(name: str, text: Any, known: Iterable[str]) -> Tree:
    """The tree of a text that may use the names `known`.

    **Raises** `ValueError` that names the setting `name`, the column and what is wrong there.
    """
    try:
        if not isinstance(text, str):
            raise FormulaError(1, "must be a text")
        tree = parsed(text)
        for part in _names(tree):
            if part.name not in {*known, *CONSTANTS}:
                raise FormulaError(part.column, str(unknown("name", part.name, known)))
        return tree
    except FormulaError as error:
        raise ValueError(f"{name} = {shown(text)}: {error}") from None


@functools.lru_cache(maxsize=1024)
def parsed(text: str) -> Tree:
    """The tree of a text. **Raises** `FormulaError`."""
    if len(text) > LONGEST:
        raise FormulaError(LONGEST + 1, f"longer than {LONGEST} characters")
    reader = _Reader(_tokens(text.translate(_SAME)))
    tree = reader.condition()
    if reader.next.kind != "end":
        raise reader.unexpected("an operator or the end")
    return tree


def used(tree: Tree) -> set[str]:
    """The names that a formula reads."""
    return {part.name for part in _names(tree)} - set(CONSTANTS)


def is_condition(tree: Tree) -> bool:
    """Whether it is true or false."""
    return tree.name in OPERATORS and OPERATORS[tree.name].condition


def evaluate(tree: Tree, values: Mapping[str, Any]) -> Any:
    """The value of a formula for these values of names, element by element; of a condition, 1 or 0."""
    if not tree.parts:
        given = values[tree.name] if tree.name in values else CONSTANTS.get(tree.name, tree.number)
        return jnp.asarray(given, float)
    parts = [evaluate(part, values) for part in tree.parts]
    if tree.name == "^" and not tree.parts[1].name:
        power = tree.parts[1].number
        if power.is_integer() and abs(power) <= 64:  # exact, and right for negative numbers
            return jnp.power(parts[0], int(power))
    function = OPERATORS.get(tree.name) or FUNCTIONS[tree.name]
    return jnp.asarray(function.apply(*parts), float)


def _names(tree: Tree) -> Iterable[Tree]:
    if tree.name and not tree.parts:
        yield tree
    for part in tree.parts:
        yield from _names(part)


def _tokens(text: str) -> list[Token]:
    tokens, place = [], 0
    while (place := len(text) - len(text[place:].lstrip())) < len(text):
        found = _TOKEN.match(text, place)
        if found is None:
            raise FormulaError(place + 1, f"{text[place]!r} has no meaning here")
        kind, word = str(found.lastgroup), found.group()
        if kind == "number" and float(word) > LARGEST:
            raise FormulaError(place + 1, f"{word} is too large for single precision")
        tokens.append(Token("sign" if word in WORDS else kind, word, place + 1))
        place = found.end()
    return [*tokens, Token("end", "", len(text) + 1)]


class _Reader:
    """Reads tokens from left to right; each method reads what the grammar calls by its name."""

    def __init__(self, tokens: list[Token]):
        self.tokens, self.place, self.depth = tokens, 0, 0

    @property
    def next(self) -> Token:
        return self.tokens[self.place]

    def take(self, *signs: str) -> Token | None:
        """The next token if it is one of these signs."""
        token = self.next
        if token.kind != "sign" or token.text not in signs:
            return None
        self.place += 1
        return token

    def unexpected(self, wanted: str) -> FormulaError:
        found = shown(self.next.text) if self.next.text else "the end"
        hint = "; a power is written ^" if self.next.text == "*" and self.tokens[self.place - 1].text == "*" else ""
        hint = hint or ("; join comparisons by 'and'" if self.next.text in COMPARISONS else "")
        return FormulaError(self.next.column, f"{wanted} is expected, not {found}{hint}")

    def deeper(self, token: Token) -> None:
        self.depth += 1
        if self.depth > NESTED:
            raise FormulaError(token.column, f"nested deeper than {NESTED}")

    def chain(self, part: Any, *signs: str) -> Tree:
        """Parts between signs, from left to right."""
        tree = part()
        while token := self.take(*signs):
            tree = Tree(token.column, token.text).of(tree, part())
        return tree

    def condition(self) -> Tree:
        return self.chain(self.both, "or")

    def both(self) -> Tree:
        return self.chain(self.inverse, "and")

    def inverse(self) -> Tree:
        if token := self.take("not"):
            self.deeper(token)
            tree = Tree(token.column, "not").of(self.inverse())
            self.depth -= 1
            return tree
        return self.comparison()

    def comparison(self) -> Tree:
        tree = self.sum()
        if token := self.take(*COMPARISONS):
            tree = Tree(token.column, token.text).of(tree, self.sum())
        return tree

    def sum(self) -> Tree:
        return self.chain(self.term, "+", "-")

    def term(self) -> Tree:
        return self.chain(self.factor, "*", "/")

    def factor(self) -> Tree:
        if token := self.take("-", "+"):
            self.deeper(token)
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
        if token := self.take("^"):
            self.deeper(token)
            base = Tree(token.column, "^").of(base, self.factor())
            self.depth -= 1
        return base

    def atom(self) -> Tree:
        token = self.next
        if self.take("("):
            return self.bracket(token)[0]
        if token.kind not in ("number", "name"):
            raise self.unexpected("a number, a name or a bracket")
        self.place += 1
        if token.kind == "number":
            return Tree(token.column, number=float(token.text))
        if not self.take("("):
            if token.text in FUNCTIONS:
                raise FormulaError(token.column, f"{token.text} is a function: '(' is expected after it")
            return Tree(token.column, token.text)
        if token.text not in FUNCTIONS:
            raise FormulaError(token.column, str(unknown("function", token.text, FUNCTIONS)))
        parts, wanted = self.bracket(token, list=True), FUNCTIONS[token.text].arguments
        if len(parts) != wanted:
            plural = "argument" if wanted == 1 else "arguments"
            raise FormulaError(token.column, f"{token.text} takes {wanted} {plural}, not {len(parts)}")
        return Tree(token.column, token.text).of(*parts)

    def bracket(self, token: Token, list: bool = False) -> list[Tree]:
        """What stands in brackets, of which the first is read already."""
        self.deeper(token)
        parts = [self.condition()]
        while list and self.take(","):
            parts.append(self.condition())
        if not self.take(")"):
            raise self.unexpected("',' or ')'" if list else "')'")
        self.depth -= 1
        return parts
