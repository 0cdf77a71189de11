"""Help for settings, from the docstrings of their classes, so that each text is written once."""

import ast
import functools
import inspect
import re
import textwrap
from itertools import pairwise
from typing import Any

FIELD = re.compile(r"^- `(\w+)`([^`:]*): (.*?)(?=\n- |\n\n|\Z)", re.DOTALL | re.MULTILINE)
WORD = re.compile(r"[a-z]+(?=[\s,:;-]|$)")  # not a symbol or a name, such as ρ, k_SE and motorgrad.make
SYMBOLS = {
    r"\alpha": "α", r"\beta": "β", r"\gamma": "γ", r"\delta": "δ", r"\Delta": "Δ", r"\epsilon": "ε",
    r"\varepsilon": "ε",
    r"\theta": "θ", r"\kappa": "κ", r"\lambda": "λ", r"\mu": "μ", r"\pi": "π", r"\rho": "ρ", r"\sigma": "σ",
    r"\phi": "φ", r"\tau": "τ", r"\nabla": "∇", r"\sum": "Σ", r"\infty": "∞", r"\in": " ∈ ", r"\ge": " ≥ ",
    r"\le": " ≤ ", r"\times": " × ", r"\cdot": "·", r"\mid": " | ", r"\leftarrow": " ← ", r"\frac12": "½",
    r"\ldots": "…",
}  # fmt: skip


def name_in_words(cls: type) -> str:
    """The name of a class in words, such as "critic fit"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", cls.__name__).lower()


def description_of(cls: type) -> str:
    """What a docstring says before its list of arguments and its example."""
    return _without_formulas(summary_of(cls)).replace("`", "")


def summary_of(cls: type) -> str:
    """What a docstring says before its list of arguments or errors and its example, as it stands there."""
    return re.split(r"\*\*(?:Arguments|Raises)|```", _doc(cls))[0].strip()


def field_texts(cls: Any) -> dict[str, tuple[str, str]]:
    """What the docstrings of a class and of its bases, or of a function, say of each field, as it stands there.

    A field's text stands in a line "- `name` (unit): text" or "- `name` of what: text". **Returns** what follows the
    name, and the text.
    """
    found: dict[str, tuple[str, str]] = {}
    for base in getattr(cls, "__mro__", (cls,)):
        for name, more, text in FIELD.findall(_doc(base)):
            found.setdefault(name, (more, text))
    return found


@functools.cache
def descriptions(cls: Any) -> dict[str, str]:
    """The texts of `field_texts` as sentences in plain characters, each with its unit."""
    found: dict[str, str] = {}
    for name, (more, text) in field_texts(cls).items():
        unit = more if more.startswith(" (") else ""
        text = _without_formulas(text).replace("`", "")
        said = " ".join(f"{'' if unit or not more else f'{more}: '}{text}".split())
        said = said[:1].upper() + said[1:] if WORD.match(said) else said
        found[name] = f"{said.rstrip('.')}{unit}."
    return found


@functools.cache  # which parses source code
def attribute_texts(cls: type) -> dict[str, str]:
    """The docstrings below the fields of a class and of its bases, each on one line."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        except (OSError, TypeError):  # a class without a source file, such as `object`
            continue
        for field, text in pairwise(getattr(body, "body", ())):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                found[ast.unparse(field.target)] = " ".join(str(text.value.value).split())
    return found


def _without_formulas(text: str) -> str:
    """A text whose formulas between dollar signs are written in plain characters."""

    def plain(match: re.Match[str]) -> str:
        formula = match[1]
        for command, symbol in sorted(SYMBOLS.items(), key=lambda pair: -len(pair[0])):
            formula = re.sub(re.escape(command) + r"(?![a-zA-Z])", symbol, formula)
        formula = re.sub(r"\\[a-zA-Z]+\{([^}]*)\}", r"\1", formula)  # \text{level rate}
        formula = re.sub(r"\\([a-zA-Z]+)", r"\1", formula)  # \max
        return " ".join(re.sub(r"\\[,;! ]|[{}]", "", formula).split())

    return re.sub(r"\$\$?([^$]+)\$\$?", plain, text)


def _doc(cls: Any) -> str:
    own = cls.__dict__.get("__doc__") if isinstance(cls, type) else cls.__doc__
    return inspect.cleandoc(own or "")
