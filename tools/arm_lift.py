"""Make the stored table of the arm's lift anew: `python -m tools.arm_lift`, from the root of a checkout."""

from motorgrad.bodies import Arm, tabulate_lift
from motorgrad.bodies.arm._lift import STORED


def main() -> None:
    """Simulate the default arm and store its table where the package looks for it."""
    tabulate_lift(Arm()).save(STORED)
    print(f"{STORED.name}  {STORED.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
