"""The two halves of a drivetrain, cut at its shaft."""
