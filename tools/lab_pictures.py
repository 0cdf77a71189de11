"""Draw every diagram of TimLab's gallery: `python -m tools.lab_pictures [NAME …]`."""

import sys
from pathlib import Path

from motorgrad.lab import GALLERY, to_svg

IMAGES = Path(__file__).parents[1] / "docs" / "images"


def main(names: list[str]) -> None:
    """Write `lab-NAME.svg` for each name, by default for every diagram."""
    for name in names or GALLERY:
        (IMAGES / f"lab-{name}.svg").write_text(to_svg(GALLERY[name]()), encoding="utf-8")
        print(f"lab-{name}.svg", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
