"""The plants: compiled sources, description, predictor, controller design, an independent reference."""
