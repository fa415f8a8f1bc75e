"""Solvers: dense, sparse direct, and conjugate gradients with algebraic multigrid.

`LinearSolver` holds K and its supports, chooses a method and says why, and solves for as many right
sides as asked.  Every answer carries its backward error |b - A x| / (|A| |x| + |b|) in the maximum
norm: the size of the smallest change of A and b for which x would be exact.
"""
