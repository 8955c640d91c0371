"""Sources of the FMUs: pure equations on plain floats, and the adapters that export them with PythonFMU.

Nothing here imports anything outside the standard library (``pythonfmu`` in the adapters apart), so the same
files run inside an FMU and, translated to C, in native FMUs and in the kernels of the orchestrator.
"""
