"""Translation of the sources of our FMUs, a typed subset of Python, to C99. See ``docs/native.md``."""
