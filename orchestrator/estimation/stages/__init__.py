"""Where in a train of two stages the gap is: see ``docs/estimation.md``."""
