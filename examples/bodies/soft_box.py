# A pseudo-rigid box of very soft rubber: it is thrown while it spins about its axis of largest inertia, the
# spin pulls it wide, and so it breathes.

import kratos_lite as kl

body = kl.PseudoRigidBody(
    kl.box((0.4, 0.6, 1.0), cells=(2, 3, 5)),
    kl.Isotropic3D(E=5e4, nu=0.3, density=1000.0),
)
body.set_velocity(linear=(0.0, 5.0, 3.0), angular=(9.0, 0.0, 0.0))  # m/s, rad/s
body.add(kl.Gravity((0.0, 0.0, -9.81)))  # m/s²

dt, steps, every = 0.002, 300, 3  # s
