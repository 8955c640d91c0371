"""Which effects a model lacks: screening, search, equivalence, grades, and what remains."""
