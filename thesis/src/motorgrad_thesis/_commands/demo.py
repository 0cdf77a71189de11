"""`motorgrad demo`: train hoppers, and show what they learned."""

import dataclasses
import os
import shutil
import sys
from pathlib import Path

from motorgrad._extras import FILM, require
from motorgrad._files import check_writable
from motorgrad.options import json_help, parse, summary, write_json
from motorgrad.schema import Settings, count, number, static
from motorgrad.tasks import Hopper
from motorgrad.training import check_training
from motorgrad_thesis import demo

PERIOD = Hopper().period
MAX_SECONDS = 1e7
MAX_FILM_SECONDS = 3600.0


@dataclasses.dataclass(frozen=True)
class Demo(Settings):
    """Train eight hoppers, and show a learning curve, the behaviour before and after, and a film."""

    out: Path = static(Path("runs/demo"), help="The run directory. An unfinished run found there is continued")
    seconds: float = number(
        1200.0, PERIOD, MAX_SECONDS, unit="simulated s", help="The length of each hopper's practice"
    )
    seeds: int = count(8, 1, help="The number of hoppers")
    film_seconds: float = number(8.0, 0, MAX_FILM_SECONDS, open_low=True, unit="s", help="The length of the film")
    json: Path | None = static(None, help=json_help())

    def validate(self) -> None:
        check_training(Hopper(), None, round(self.seconds / PERIOD), self.seeds)
        check_writable("out", self.out, folder=True)
        require(*FILM)


def run(arguments: list[str]) -> int:
    options = parse(Demo, arguments, "demo")
    try:
        shown = demo.demonstrate(options.out, options.seconds, options.seeds, options.film_seconds)
    except KeyboardInterrupt:
        print(f"stopped; everything is saved in {options.out}, and the same command continues", file=sys.stderr)
        return 130
    if str(options.json) != "-":
        _print(shown, options.out)
    files = {name: str(path) for name, path in shown.files.items()}
    heights = {"before": summary(shown.before.metrics["apex"]), "after": summary(shown.after.metrics["apex"])}
    write_json(options.json, {"files": files, "apex": heights, "seconds": shown.seconds, "run": str(options.out)})
    return 0


def _print(shown: demo.Demonstration, out: Path) -> None:
    program = "motorgrad" if shutil.which("motorgrad") else os.path.relpath(sys.argv[0])
    print("\n" + "\n".join(demo.in_words(shown)))
    print(f"\nIt took {shown.seconds:.0f} s. Look at:")
    for what, path in shown.files.items():
        print(f"  {what:<28} {path}")
    for note in shown.notes:
        print(note)
    print("\nTry next:")
    print(f"  {program} evaluate {out} --mode mode        most probable actions only")
    print(f"  {program} train hopper --task.penalty 0.3 --seeds 4 --out runs/lazy")
    print(f"  {program} plot {out} runs/lazy --quantity apex")
    print(f"  {program} list                              tasks, policies and experiments")
