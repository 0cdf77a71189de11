"""Make the stored tables of the arm's lifts anew: `python -m tools.arm_lift`, from the root of a checkout."""

from motorgrad.bodies import Arm, tabulate_lift
from motorgrad.bodies.arm._lift import STORED


def main() -> None:
    """Simulate the arm in each posture and store its table where the package looks for it."""
    for posture, file in STORED.items():
        tabulate_lift(Arm(posture=posture)).save(file)
        print(f"{file.name}  {file.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
