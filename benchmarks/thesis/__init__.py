"""The thesis's published numbers beside recomputed ones, and its errata shown by computation.

Source: M. F. Akar, "Identification of Mechanical Backlash in Electromechanical Systems for Control Purposes",
M.Sc. thesis, Gaziantep University. Equations, figures and tables carry its numbering.
"""
