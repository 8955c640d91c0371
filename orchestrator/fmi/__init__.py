"""FMUs: building ours, loading anybody's."""
