"""Verdicts as text and in the formats that platforms of continuous integration read."""
