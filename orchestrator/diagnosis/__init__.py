"""Diagnosis: where a record and the model disagree, which effect is missing, and the proof that adding it helps."""
