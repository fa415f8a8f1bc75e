# A scene for the command line: a script that defines body, dt, steps and, if wanted, every.
#
#     kratos-lite solve examples/bodies/thrown_box.py --picture out/thrown_box.png
#
# The box is slowed by drag in a wind.

import numpy as np

import kratos_lite as kl

wind = np.array([-6.0, 0.0, 0.0])  # m/s


def drag(q, u, t):
    """Return the drag on a rigid body: a force in N on its mass center, against the flow around it."""
    flow = wind - u[3:]
    return np.concatenate([np.zeros(3), 2.0 * np.linalg.norm(flow) * flow])  # 2 N s²/m²


body = kl.RigidBody(
    kl.box((0.4, 0.6, 1.0), cells=(2, 3, 5)),
    kl.Isotropic3D(E=1e6, nu=0.3, density=100.0),  # 24 kg
    integrator="RIG_IMP",
)
body.set_velocity(linear=(6.0, 0.0, 4.905), angular=(0.05, 10.0, 0.05))  # m/s, rad/s
body.add(kl.Gravity((0.0, 0.0, -9.81)))  # m/s²
body.add(kl.Callback(drag))

dt, steps, every = 0.002, 500, 10  # s
