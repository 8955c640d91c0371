"""System Structure and Parameterization (SSP 1.0): our systems as files for other tools, and theirs for our master."""
