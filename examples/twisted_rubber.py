# %% [markdown]
# # A twisted bar of rubber
#
# A bar of rubber, 4 m long, is twisted by half a turn in eight steps, its ends kept apart.  It resists with
# a torque, and it pushes its ends outwards, which no linear theory knows: J. Poynting saw it in 1909.

# %%
import sys

import numpy as np

import kratos_lite as kl

bar = kl.box((1, 1, 4), (2, 2, 8), "TotalLagrangianElement3D20N", origin=(-0.5, -0.5, 0))  # m
rubber = kl.NeoHookean3D(E=1e6, nu=0.4)  # Pa
model = kl.Model(bar, rubber)
model.fix("z-")
top = bar.nodes("z+")


def along_circle(place, axis):
    """Return the displacement of a place along an axis in time, half a turn in 1 s."""
    radius, start = np.hypot(*place[:2]), np.arctan2(place[1], place[0]) - np.pi / 2 * (axis == "y")
    return lambda t: float(radius * (np.cos(start + np.pi * t) - np.cos(start)))


model.fix("z+", "z")
for node in top:
    for axis in "xy":
        model.fix([int(node)], axis, along_circle(bar.points[node], axis))

# %%
analysis = model.quasi_static()
for state in kl.integrate(analysis, dt=0.125, steps=8, every=2):
    force = state.reactions[top]
    place = bar.points[top] + state.u[top]
    torque = (place[:, 0] * force[:, 1] - place[:, 1] * force[:, 0]).sum()
    print(f"{180 * state.time:3.0f}°: torque {torque / 1e3:5.1f} kN m, push {-force[:, 2].sum():6.0f} N")
print(f"Newton's method took {sum(step.iterations for step in analysis.reports)} iterations")

# %%
if len(sys.argv) > 1:
    analysis.result().plot(sys.argv[1], scale=1, title="Von Mises stress after half a turn", size=(6, 5))
