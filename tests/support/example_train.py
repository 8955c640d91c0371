"""Makes the record of the two-stage example: ``python -m tests.support.example_train`` writes it anew."""

from tests.support.example_record import EXAMPLES
from tests.support.independent_plant import write_csv
from tests.support.two_stage_record import FRICTION, make_two_stage_record

HALF_GAP = 0.015  # rad of stage 2, at the load

if __name__ == "__main__":
    columns, _ = make_two_stage_record({"alpha_2": HALF_GAP} | FRICTION, seed=2028, share=0.2, duration=2.0)
    write_csv(EXAMPLES / "train.csv", columns)
