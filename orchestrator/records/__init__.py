"""Measured records and the model files that they are compared with."""
