"""Building of our own FMUs. Loading of anybody's is the business of ``orchestrator.fmi``."""
