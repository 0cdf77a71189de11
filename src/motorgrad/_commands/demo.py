"""`motorgrad demo`: a body learns to hop."""

import dataclasses
from pathlib import Path

from motorgrad._commands._shared import parse, summary, write_json
from motorgrad.experiments import demo


@dataclasses.dataclass(frozen=True)
class Demo:
    """Eight hoppers learn to hop: a learning curve, the behaviour before and after, and a film."""

    out: Path = Path("runs/demo")
    """The run directory. An unfinished run found there goes on."""
    seconds: float = 1200.0
    """Simulated seconds of practice for each hopper."""
    seeds: int = 8
    """How many hoppers."""
    json: Path | None = None
    """Also write the result to this file, for machines; - for the standard output."""


def run(arguments: list[str]) -> int:
    options = parse(Demo, arguments, "demo")
    shown = demo.demonstrate(options.out, options.seconds, options.seeds)
    if str(options.json) != "-":
        print()
        print("\n".join(demo.in_words(shown)))
        print(f"\nIt took {shown.seconds:.0f} s. Look at:")
        for what, path in shown.files.items():
            print(f"  {what:<28} {path}")
        print("\n".join(shown.notes))
        print("Try next:")
        print(f"  motorgrad evaluate {options.out} --mode mode        the most probable actions only")
        print("  motorgrad train hopper --task.penalty 0.3 --seeds 4 --out runs/lazy")
        print(f"  motorgrad plot {options.out} runs/lazy --quantity apex")
        print("  motorgrad list                              what else there is")
    files = {name: str(path) for name, path in shown.files.items()}
    heights = {"before": summary(shown.before.readings["apex"]), "after": summary(shown.after.readings["apex"])}
    write_json(options.json, {"files": files, "apex": heights, "seconds": shown.seconds, "run": str(options.out)})
    return 0 if shown.run.complete else 130
