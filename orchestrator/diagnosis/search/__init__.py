"""The search: candidates screened, fitted, accepted and taken out again."""
