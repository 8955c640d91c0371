"""Checks of FMUs; the code is in the folder ``code`` beside this file."""
