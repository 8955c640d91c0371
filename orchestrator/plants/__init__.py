"""The plants: compiled sources, description, coarse runs, controller design."""
