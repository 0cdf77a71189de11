"""The score of the statements of the thesis, on the page about the reproduction, from recorded results.

    python -m tools.score runs/reproduce    # after motorgrad reproduce: records its statements and redraws the page
    python -m tools.score                   # redraws the page

`docs/data/reproduction.json` keeps how every statement stands, by experiment. A smoke test is not recorded.
"""

import json
import sys
from pathlib import Path
from typing import Any

from motorgrad_thesis import EXPERIMENTS, Statement, score_rows, statements
from motorgrad_thesis._records import RECORD, read_record
from motorgrad_thesis._score import HEADS

DOCS = Path(__file__).parent.parent / "docs"
DATA = DOCS / "data" / "reproduction.json"
PAGE = DOCS / "reproduction.md"
START = "<!-- score: made by python -m tools.score -->\n"
END = "<!-- end of the score -->\n"
FIELDS = ("part", "words", "source", "claims", "standing", "reasons")


def recorded(data: dict[str, list[dict[str, Any]]]) -> list[Statement]:
    """The statements on record, in the order of the experiments."""
    return [
        Statement(experiment=name, **{**each, "reasons": tuple(each["reasons"])})
        for name in EXPERIMENTS
        for each in data.get(name, [])
    ]


def updated(data: dict[str, list[dict[str, Any]]], records: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """The data with the statements of these records. The reason that somebody wrote for a statement is kept as long as
    it stands as it did."""
    changed = dict(data)
    for record in records:
        before = {(each["words"], each["standing"]): each["reasons"] for each in data.get(record["name"], [])}
        found = [{field: getattr(each, field) for field in FIELDS} for each in statements([record])]
        changed[record["name"]] = [
            each | {"reasons": list(before.get((each["words"], each["standing"])) or each["reasons"])} for each in found
        ]
    return {name: changed[name] for name in EXPERIMENTS if changed.get(name)}


def block(found: list[Statement]) -> str:
    """The table, and the statements that are refuted or not testable with their reasons, as Markdown."""
    lines = [_line(HEADS), _line("---" for _ in HEADS), *map(_line, score_rows(found)), ""]
    for standing, title in (("refuted", "Refuted"), ("not testable", "Not testable")):
        lines += [f"**{title}:**", ""]
        for each in found:
            if each.standing == standing:
                why = f": {'; '.join(each.reasons)}" if each.reasons else ""
                lines.append(f"* *{each.words}* ({each.source}; `{each.experiment}`){why}")
        lines.append("")
    return "\n".join(lines)


def _line(cells: Any) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def drawn(page: str, found: list[Statement]) -> str:
    """The page with the score in its place."""
    before, rest = page.split(START)
    return f"{before}{START}\n{block(found)}\n{END}{rest.split(END)[1]}"


def main(folders: list[str]) -> None:
    files = sorted(file for folder in folders for file in Path(folder).glob("*/record.json"))
    records = [record for record in (read_record(file, RECORD) for file in files) if not record["quick"]]
    data = updated(json.loads(DATA.read_text()), records)
    DATA.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n")
    PAGE.write_text(drawn(PAGE.read_text(), recorded(data)))


if __name__ == "__main__":
    main(sys.argv[1:])
