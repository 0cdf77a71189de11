"""Texts about settings, for people, from what their fields declare."""

import dataclasses
import functools
import inspect
import re
from typing import Any

from motorgrad.schema._declare import Declared, declared_by, inherited_fields

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


def with_fields(cls: type) -> None:
    """Complete the docstring of a class whose fields declare what they are: all arguments, before errors and examples.

    A class has it called when it is defined; the fields that are its own are then still attributes.
    """
    own = vars(cls).get("__doc__")
    fields = inherited_fields(cls)
    fields |= {name: value for name, value in vars(cls).items() if isinstance(value, dataclasses.Field)}
    lines = []
    for name, field in fields.items():
        declared = declared_by(field)
        if field.init and declared.help:
            unit = declared.unit and f" ({declared.unit})"
            ends = "" if declared.range is None else declared.range.ends
            lines.append(f"- `{name}`{unit}: {declared.help}{ends and f'; {ends}'}.")
    if own and lines:
        text = inspect.cleandoc(own)
        place = re.search(r"\n*(?=\*\*Raises|```|\Z)", text)
        start = len(text) if place is None else place.start()
        end = len(text) if place is None else place.end()
        arguments = "\n".join(["**Arguments:**", "", *lines])
        cls.__doc__ = "\n\n".join(filter(None, [text[:start], arguments, text[end:]]))


@functools.cache
def descriptions(cls: Any, units: bool = True) -> dict[str, str]:
    """What the fields of a class declare that they are, as sentences in plain characters, each with its unit or not."""
    declared = {field.name: declared_by(field) for field in dataclasses.fields(cls) if field.init}
    return {name: sentence(each, units) for name, each in declared.items() if each.help}


def sentence(declared: Declared, unit: bool = True) -> str:
    """What a field declares that it is, as a sentence in plain characters, with its unit or without."""
    said = " ".join(_without_formulas(declared.help).replace("`", "").split())
    said = said[:1].upper() + said[1:] if WORD.match(said) else said
    return f"{said.rstrip('.')}{f' ({declared.unit})' if unit and declared.unit else ''}."


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
