"""One module per command, each with ``add_arguments(parser)`` and ``run(arguments) -> exit code``.

Printing, progress bars and exit codes live here and nowhere else.
"""
