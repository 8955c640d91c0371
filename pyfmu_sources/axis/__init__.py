"""The servo axis: one body and its drive."""
