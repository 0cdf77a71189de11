"""Draw the documentation's figures: `python -m tools.figures [NAME …]`, from the root of a checkout.

Without names all of them are drawn, which takes some minutes. Long runs are kept in `runs/figures`, and used again.
The figures of experiments come from a folder of `motorgrad reproduce all`: `python -m tools.figures --reproduced DIR`.
"""

import argparse
import io
import time
from pathlib import Path

import matplotlib
from PIL import Image

from timsim import write_film, write_replay
from tools.figures._registry import FIGURE_NAMES, FILMS, REPLAYS, made
from tools.figures._style import STYLE
from tools.figures._work import Work

ROOT = Path(__file__).parents[2]


def main() -> None:
    """Draw the figures that are named, or all."""
    parser = argparse.ArgumentParser(prog="python -m tools.figures", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one of {', '.join(FIGURE_NAMES)}; by default all")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images", help="the folder of the pictures")
    parser.add_argument("--reproduced", type=Path, help="take the figures of experiments from this folder, and no more")
    parser.add_argument("--films", action="store_true", help="make all films, and no figure")
    options = parser.parse_args()
    for name in options.names:
        if name not in FIGURE_NAMES:
            parser.error(f"no figure is called {name!r}; there are {', '.join(FIGURE_NAMES)}")
    options.out.mkdir(parents=True, exist_ok=True)
    if options.reproduced:
        for figure in sorted(options.reproduced.glob("*/figure.png")):
            lighten(figure, options.out / f"{figure.parent.name}.png")
        return
    for name in FILMS if options.films else options.names or FIGURE_NAMES:
        started = time.monotonic()
        work = Work(runs=ROOT / "runs" / "figures")
        path = options.out / f"{name}{'.webp' if name in FILMS else '.png'}"
        draw(name, work, path)
        print(f"{path.name}  {time.monotonic() - started:.0f} s", flush=True)


def draw(name: str, work: Work, path: Path) -> None:
    """Draw one figure, or film one film, into a file; the same numbers give the same bytes."""
    if name in FILMS:
        motions = FILMS[name](work)
        write_film(motions, path, fps=20, width=400, height=300)
        if name in REPLAYS:
            write_replay(motions, path.with_suffix(".html"), title=name.replace("-", " ").capitalize())
        return
    with matplotlib.rc_context(STYLE):
        picture = io.BytesIO()
        made(name, work).savefig(picture, dpi=160)
    lighten(picture, path)


def lighten(picture: io.BytesIO | Path, path: Path) -> None:
    """Save a picture with 256 colours, which are plenty, and a third of the bytes."""
    Image.open(picture).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
