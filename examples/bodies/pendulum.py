# A pendulum of 1 m on a rod without mass, let go from the horizontal: its period is
# 4 sqrt(l/g) K(1/2) = 2.3606811980 s for g = π², and after it the cube is back where it was.

import numpy as np

import kratos_lite as kl

body = kl.RigidBody(
    kl.box((0.2, 0.2, 0.2), origin=(0.9, -0.1, -0.1)),
    kl.Isotropic3D(E=1e9, nu=0.3, density=125.0),  # 1 kg
)
body.add(kl.Gravity((0.0, 0.0, -(np.pi**2))))  # m/s²
body.constrain(kl.RigidLink(point=(1.0, 0.0, 0.0), anchor=(0.0, 0.0, 0.0)))

dt, steps, every = 0.002360681198, 1000, 10  # s
