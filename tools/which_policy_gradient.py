"""The figures of the study "which policy gradient, when", from the folder of its comparison.

motorgrad compare tools/studies/which-policy-gradient.toml
python -m tools.which_policy_gradient runs/which-policy-gradient [docs/images]
"""

import sys
from pathlib import Path

from motorgrad.studies import ComparisonResults


def main(folder: str, out: str = "docs/images") -> None:
    """Write every figure into a folder."""
    Path(out).mkdir(parents=True, exist_ok=True)
    for name, svg in ComparisonResults.load(folder).figures.items():
        path = Path(out) / f"which-{name}.svg"
        path.write_text(svg, encoding="utf-8")
        print(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
