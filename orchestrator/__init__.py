"""FMI co-simulation toolchain that measures the backlash of a geared drivetrain."""

__version__ = "0.1.0"
