"""Settings: declared once where they stand, and read, built, checked, changed and explained in this one place.

    decay: float = number(0.9, 0, 1, help="factor by which the trace decays in each decision")

`build` makes the object from a plain table, whoever wrote it: a file, a call, the command line, a stored run, a block.
"""

from motorgrad.schema._build import MAX_SINGLE_PRECISION, as_hinted, build, convert, deeper, expanded, full_path
from motorgrad.schema._declare import (
    Declared,
    Kind,
    Range,
    count,
    declared_by,
    default_of,
    holds_numbers,
    inner,
    number,
    plain_numbers,
    static,
)
from motorgrad.schema._numbers import (
    Numbers,
    check_rounded,
    declared_at,
    numbers_of,
    parts_by_path,
    path_of,
    with_number,
)
from motorgrad.schema._part import (
    PART_CLASSES,
    Part,
    fields_of,
    hints_of,
    is_tracer,
    kind_of,
    options_of,
    parts_in,
    register,
    with_article,
)
from motorgrad.schema._settings import Settings, check_fields
from motorgrad.schema._table import table
from motorgrad.schema._texts import description_of, descriptions, name_in_words, sentence, summary_of
from motorgrad.schema._words import Words

__all__ = [
    "MAX_SINGLE_PRECISION",
    "PART_CLASSES",
    "Declared",
    "Kind",
    "Numbers",
    "Part",
    "Range",
    "Settings",
    "Words",
    "as_hinted",
    "build",
    "check_fields",
    "check_rounded",
    "convert",
    "count",
    "declared_at",
    "declared_by",
    "deeper",
    "default_of",
    "description_of",
    "descriptions",
    "expanded",
    "fields_of",
    "full_path",
    "hints_of",
    "holds_numbers",
    "inner",
    "is_tracer",
    "kind_of",
    "name_in_words",
    "number",
    "numbers_of",
    "options_of",
    "parts_by_path",
    "parts_in",
    "path_of",
    "plain_numbers",
    "register",
    "sentence",
    "static",
    "summary_of",
    "table",
    "with_article",
    "with_number",
]
