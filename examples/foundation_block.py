# %% [markdown]
# # A machine on a foundation block
#
# A block of concrete on soil carries a machine that shakes it.  Up and down, block and machine swing as one
# mass on one spring; a force to the side meets two resonances, in which the block slides and rocks.

# %%
import sys

import numpy as np

import kratos_lite as kl

block = kl.box((2.0, 1.5, 1.0), cells=(4, 3, 2))  # m
model = kl.Model(block, kl.Isotropic3D(E=30e9, nu=0.2, density=2500.0))
model.add(kl.ElasticSupport("z-", (2e7, 2e7, 4e7)))  # of the soil along x, y, z in N/m³
machine = model.rigid("z+", (1.0, 0.75, 1.5))
model.add_mass(machine, 1500.0, inertia=200 * np.eye(3))  # kg, kg m² about the point

# %%
force, damping = 1e3, 0.05  # N, ratio of each mode
frequencies = 2 * np.pi * np.linspace(1.0, 60.0, 500)  # rad/s
foot = (2.0, 0.75, 0.0)
swing = {}
for axis, way in (("x", (force, 0, 0)), ("z", (0, 0, force))):
    swing[axis] = model.harmonic(frequencies, damping=damping, loads=[machine.load(way)])
    u = np.abs(swing[axis].at(foot)[:, "xyz".index(axis)])
    for i in 1 + np.flatnonzero((u[1:-1] > u[:-2]) & (u[1:-1] > u[2:])):
        print(f"along {axis}: {1e6 * u[i]:.1f} µm at {frequencies[i]:.1f} rad/s")

mass, spring = 2500.0 * 3.0 + 1500.0, 4e7 * 3.0
r = frequencies / np.sqrt(spring / mass)
one = force / spring / np.abs(1 - r**2 + 2j * damping * r)
off = np.abs(np.abs(swing["z"].at(foot)[:, 2]) / one - 1).max()
print(f"one mass on one spring: {1e6 * one.max():.1f} µm, the curve is within {100 * off:.1f} %")

# %%
if len(sys.argv) > 1:
    figure = swing["x"].plot(foot, "x")
    axes = figure.axes[0]
    axes.lines[0].set_label("along x, by a force of 1 kN along x")
    upwards = np.abs(swing["z"].at(foot)[:, 2])
    axes.plot(frequencies, upwards, "--", color="#c8442b", label="along z, by one along z")
    axes.set_ylabel("amplitude of the foot")
    axes.legend(frameon=False)
    figure.savefig(sys.argv[1])
