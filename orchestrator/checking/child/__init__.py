"""The process that runs a stranger's FMU. Standard library only; the parent sets the limits and watches it."""
