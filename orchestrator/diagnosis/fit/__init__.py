"""Fits of a model to a record: likelihood of innovations, damped fit, standard errors from blocks."""
