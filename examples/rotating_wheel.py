# %% [markdown]
# # A rotating wheel with a contact fixed in space
#
# A rubber wheel turns on a rigid hub and is pressed from below.  Its mesh stands still while the material
# runs through it, so that the contact stays where it is and the state is steady: one linear solution.

# %%
import sys

import numpy as np

import kratos_lite as kl

mesh = kl.annulus(0.3, 1.0, 0.25, cells=(4, 64, 1), element="KinematicLinear3D20N")  # m
x, y, z = mesh.points.T
mesh = mesh.replace(points=np.column_stack([x, 0.25 - z, y]))  # axis is -y
rubber = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)  # Pa, –, kg/m³
p0, width = 4e6, 0.15  # Pa, rad


def contact(X):
    """Return the pressure in Pa at places (m, 3): a bell over the angle, which is counted from below."""
    angle = np.arctan2(X[:, 0], -X[:, 2])
    return p0 * np.exp(-((angle / width) ** 2) / 2)


def wheel(rate, pressed=True, damping=0.0):
    """Return the result of a wheel in plane strain that turns with so many rad/s."""
    model = kl.Model(mesh, rubber)
    model.fix("inner", "xz")
    model.fix(range(mesh.n_nodes), "y")
    model.add(kl.ale.Rotation((0, -1, 0), rate, damping=damping))
    if pressed:
        model.add(kl.Pressure("outer", contact))
    return model, model.solve()


# %% [markdown]
# What the contact does is what remains without the centrifugal growth.  The faster the wheel, the softer it
# is against a load that stands still, and with damping the dent is carried along and no longer symmetric.


# %%
def dents(rate, degrees, **options):
    """Return how far the rim moves inwards by the contact, so many degrees from it, in mm per MPa."""
    change = wheel(rate, **options)[1].u - wheel(rate, pressed=False, **options)[1].u
    places = np.column_stack([np.sin(np.radians(degrees)), -np.cos(np.radians(degrees))])
    at = [np.abs(mesh.points[:, [0, 2]] - place).max(axis=1) < 1e-9 for place in places]
    return [-(change[a][:, [0, 2]] @ p).mean() / p0 * 1e9 for a, p in zip(at, places, strict=True)]


for rate in (0.0, 30.0, 60.0):
    print(f"{rate:g} rad/s: the contact is pressed in by {dents(rate, [0])[0]:.4f} mm per MPa")
before, behind = dents(30.0, [45, -45], damping=20.0)
print(f"with damping, 45° to each side: {before:.4f} and {behind:.4f} mm per MPa")

# %%
model, result = wheel(60.0)
force, _ = kl.reaction_resultant(model, result, "inner")
m = result.report.motion
mesh_rate, wave_rate = m["critical_rate"], m["critical_rate_of_waves"]
print(f"critical rate {mesh_rate:.1f} rad/s, about {wave_rate:.1f} rad/s by wave speeds")
print(f"the hub carries {force[2] / 1e3:.2f} kN")

# %%
if len(sys.argv) > 1:
    title = "Wheel at 60 rad/s, pressed from below: von Mises stress"
    result.plot(sys.argv[1], title=title, size=(6, 5))
