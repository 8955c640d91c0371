"""Write the calibrations that come with the package: the default experiment at the noise levels of ``sweep``.

python -m tools.calibrations

They are named by a hash of the sources that their numbers come from. So they are wanted again whenever one of these
changes (a test says so); until then they are made on the user's machine.
"""

from orchestrator.paired.calibration import SHIPPED, calibrate, calibration_text
from orchestrator.paired.experiment import Experiment
from tools import refuse_arguments

NOISE = (0.0, 1e-4)


def main() -> None:
    """Make both, then replace those that are there."""
    found = [calibrate(Experiment(encoder_noise=level)) for level in NOISE]
    SHIPPED.mkdir(exist_ok=True)
    for old in SHIPPED.glob("*.json"):
        old.unlink()
    for calibration in found:
        (SHIPPED / f"{calibration.digest}.json").write_text(calibration_text(calibration), encoding="utf-8")


if __name__ == "__main__":
    refuse_arguments(__doc__)
    main()
