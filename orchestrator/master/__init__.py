"""Master algorithms over a narrow slave protocol.

::

    protocol    what a slave is: variables, a handful of calls, their order
    system      instances, connections, sources, start values: structure, checked, never run
    values      what a variable takes
    graph       execution order and algebraic loops from direct feedthrough
    signals     time signals that the master itself feeds in
    session     slaves bound to one system, run as often as needed
    layout      the one flat array of signals, and who reads and writes where
    fixed_step  Gauss-Seidel and Jacobi on the grid t0 + n h
    compiled    the same loop in machine code, for slaves that offer native calls
    iterated    algebraic loops solved by Anderson-accelerated fixed point, with rollback
    adaptive    continuous loops to a tolerance, with rollback and error control
    result      recorded signals with their units
"""
