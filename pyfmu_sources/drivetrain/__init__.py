"""The drivetrain: a motor and a load with a gap between them."""
