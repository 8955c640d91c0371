"""Estimators of the half-gap from a measured record, one file per method."""
