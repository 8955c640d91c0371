"""Walls around code that is not ours: child processes with limits that the kernel enforces where it can.

``jail`` is what other rooms use: it calls a Python entry point in a child process and kills the child at a deadline.
``walls`` is what the child puts up around itself before anything foreign is loaded, ``wire`` how the two talk,
``archives`` what may be unpacked. What is enforced by what is written down in ``docs/security.md``.
"""
