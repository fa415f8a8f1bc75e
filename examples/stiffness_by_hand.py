# %% [markdown]
# # B and K of one element by hand
#
# The class that solves a million elements is the class studied here: one element, X (8, 3).

# %%
import sys

import numpy as np

import kratos_lite as kl
from kratos_lite import Isotropic3D, KinematicLinear3D8N

X = 0.5 * KinematicLinear3D8N.nodes  # (8, 3) m: a unit cube
C = Isotropic3D(E=210e6, nu=0.3).C  # (6, 6) Pa
element = KinematicLinear3D8N(X)

K = np.zeros((24, 24))
for xi, gamma in element.rule:  # Gauss point, weight
    B = element.B(xi)  # (6, 24) 1/m
    K += B.T @ C @ B * gamma * element.detJ(xi)

np.testing.assert_allclose(K, element.stiffness(C), rtol=1e-12, atol=1e-12 * K.max())

# %% [markdown]
# The six zero eigenvalues are the rigid motions; the seventh is the softest strain.

# %%
eigenvalues = np.linalg.eigvalsh(K)
print(f"largest entry of K: {K.max():.6e} N/m")
print(f"rigid motions: {(eigenvalues < 1e-9 * eigenvalues[-1]).sum()}")

# %%
if len(sys.argv) > 1:
    kl.plot(KinematicLinear3D8N, sys.argv[1])
