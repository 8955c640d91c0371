"""Repairs of FMUs that need no source: of the archive, of modelDescription.xml and of what lies beside it."""
