"""One module per command: its results as a report."""
