"""How long tests wait for what must end by itself."""

HANGS = 3600.0  # s, after which a child process hangs: far more than a busy computer takes
