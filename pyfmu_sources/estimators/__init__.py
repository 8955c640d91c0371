"""Estimators: Kalman filter, and one that finds the gap."""
