"""Probes: what is asked of a running FMU, and what its answers must be. They run here; the FMU runs in a child."""
