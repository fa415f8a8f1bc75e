# %% [markdown]
# # A heavy top that nutates
#
# A symmetric top with J = diag(5, 5, 1) kg m² about its support spins with 25 rad/s, at first tilted by
# 0.5 rad.  Its weight gives the torque -20 Λe₃ × e₃ N m, a load of your own: `kl.Callback`.
# The tilt nods between 0.5 and 0.7576379147 rad with a period of 1.7588577458 s (elliptic integrals).

# %%
import sys

import numpy as np

import kratos_lite as kl
from kratos_lite.bodies.rotations import exp


def weight(q, u, t):
    """Return spatial force, spatial torque and referential torque."""
    axis = q[6:9]  # third column of Λ
    return np.concatenate([np.zeros(3), -20.0 * np.cross(axis, [0.0, 0.0, 1.0]), np.zeros(3)])


mesh = kl.box((0.5, 0.5, 2.0), origin=(-0.25, -0.25, -1.0))  # only to be drawn
top = kl.RigidBody(
    mesh, mass_properties=kl.MassProperties(mass=1.0, inertia=np.diag([5.0, 5.0, 1.0])), integrator="RIG_IMP"
)
top.rotate(exp(np.array([0.5, 0.0, 0.0])))
top.u[:3] = 0.0, 0.0, 25.0  # referential angular velocity, rad/s
top.add(kl.Callback(weight))

# %%
states = [kl.State.of(top), *kl.integrate(top, dt=1e-3, steps=3600)]
times = np.array([state.time for state in states])
tilt = np.array([np.arccos(state.q[8]) for state in states])
low = 1 + np.flatnonzero((tilt[1:-1] < tilt[:-2]) & (tilt[1:-1] < tilt[2:]))
print(f"tilt from {tilt.min():.6f} to {tilt.max():.6f} rad")
print(f"nutation period {np.diff(times[low])[0]:.3f} s")
print(f"vertical momentum {top.angular_momentum()[2]:.9f}, at first {25 * np.cos(0.5):.9f} kg m²/s")

# %%
if len(sys.argv) > 1:
    kl.plot(top, sys.argv[1], states=states[:880], shown=3, title="half a nutation", size=(6, 6))
