"""Controllers: LQR, and a compensator of the gap."""
