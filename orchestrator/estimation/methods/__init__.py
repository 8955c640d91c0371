"""The ways to the gap: each module has a function `estimate` of a record and a model."""
