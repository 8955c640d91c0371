"""Kernels of the plants: their equations as the analysis takes them, translated to C; see ``building.translation``.

A plant's module offers ``run`` and has ``Values``, ``values_of``, ``rates``, ``lag_of`` and ``bodies_of``. One with dry
friction has ``friction``, ``rest_levels`` and ``reaches``, too; one with teeth or end stops ``has_flanks`` and
``meets``; one with a load ``LAST_ANGLE`` and ``LAST_SPEED``. What it lacks is as in :mod:`plain`.
"""
