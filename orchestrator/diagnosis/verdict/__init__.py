"""The verdict: what record and model must have, what is left, where it sits, what else is seen."""
