"""Whitening, fits and cross-validation of any model."""
