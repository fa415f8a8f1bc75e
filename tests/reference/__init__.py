"""The whole library as a textbook has it: plain NumPy, which imports nothing of kratos_lite.

`shapes` has nodes and shape functions, `rules` quadrature, `solid` elements, loads and solutions with dense
matrices.  `problems` makes random problems, and `compare` solves them by kratos_lite and by this reference.
``python -m tests.reference 1000`` compares a thousand of them.
"""
