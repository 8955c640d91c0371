"""The plants: compiled sources, description, coarse runs, controller design, an independent reference."""
