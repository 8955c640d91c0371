"""Checks of FMUs: archive, modelDescription, binaries, and the behaviour of the running slave."""
