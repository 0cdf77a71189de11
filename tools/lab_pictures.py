"""Draw every diagram of TimLab's gallery: `python -m tools.lab_pictures [NAME …]`."""

import sys
from pathlib import Path

from motorgrad._files import write_atomically
from timlab import GALLERY, to_svg

IMAGES = Path(__file__).parents[1] / "docs" / "images"


def main(names: list[str]) -> None:
    """Write `lab-NAME.svg` for each name, by default for every diagram."""
    for name in names or GALLERY:
        write_atomically(IMAGES / f"lab-{name}.svg", to_svg(GALLERY[name]()).encode())
        print(f"lab-{name}.svg", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
