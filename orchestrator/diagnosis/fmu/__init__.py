"""Diagnosis of any FMU: a black box, and effects attached around it at its ports."""
