"""The train of two stages, each with a gap."""
