"""Scenarios of FMUs: read from TOML, run, swept."""
