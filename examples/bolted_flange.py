# %% [markdown]
# # A bolted flange under a moment
#
# Eight bolts press the flange of a pipe onto a ring.  Each is tightened by a force, then held at the length
# to which this brought it, while a moment bends the pipe.  Loose, the bolt on the side of tension would carry
# 4 M / (n D).  Tight, it takes a few hundredths of that in addition: there the joint loses pressure instead.

# %%
import sys

import numpy as np

import kratos_lite as kl

BOLTS, CIRCLE, TIGHT, MOMENT = 8, 0.21, 40e3, 1e3  # –, diameter in m, N, N m
grid = kl.annulus(0.06, 0.13, 0.14, cells=(7, 48, 14), element="8N")  # all pieces are cut out of it
cells, name = grid.blocks[0].nodes, grid.blocks[0].name
x, y, z = grid.points[cells].mean(axis=1).T
r, turn = np.hypot(x, y), np.rad2deg(np.arctan2(y, x)) + 180 / 48  # bolts are at multiples of 45°


def piece(which):
    """Return the mesh of some of the cells."""
    rows, nodes = np.unique(cells[which], return_inverse=True)
    return kl.Mesh(grid.points[rows], {name: nodes.reshape(-1, 8)})


def around(bolt, count):
    """Return which cells are in a square of so many cells around a bolt."""
    off = np.abs((turn - 45 * bolt + 180) % 360 - 180) / (360 / 48)
    return (off < count / 2) & (np.abs(r - CIRCLE / 2) < 0.01 * count / 2)


holes = np.any([around(i, 1) for i in range(BOLTS)], axis=0)
pieces = {
    "ring": piece((z < 0.02) & (r > 0.09) & ~holes),
    "flange": piece((z > 0.02) & (r < 0.07) | (z > 0.02) & (z < 0.05) & ~holes),
}
for i in range(BOLTS):
    bolt = piece((z < 0.06) & around(i, 1) | (z > 0.05) & (z < 0.06) & around(i, 3))
    axis = bolt.points.mean(axis=0) * (1, 1, 0)
    bolt = bolt.replace(points=axis + (bolt.points - axis) * (0.9, 0.9, 1))  # thinner than its hole
    pieces[f"bolt {i}"] = kl.split(bolt, lambda X: np.isclose(X[:, 2], 0.02))

# %%
model = kl.Model(kl.join(pieces), kl.Isotropic3D(E=210e9, nu=0.3))
model.fix("z-")


def at(part, height):
    """Return the nodes of a part at a height in m."""
    rows = model.mesh.nodes(part)
    return rows[np.isclose(model.mesh.points[rows, 2], height)]


model.tie(at("ring", 0.02), at("flange", 0.02))
cuts = [(f"bolt {i}.cut-", f"bolt {i}.cut+") for i in range(BOLTS)]
heads = np.concatenate([at(f"bolt {i}", 0.05) for i in range(BOLTS)])
model.tie(heads, at("flange", 0.05))
for cut in cuts:
    model.pretension(*cut, force=TIGHT)
end = model.rigid("z+", (0, 0, 0.14))
tight = model.solve()

# %%
for below, above in cuts:
    shorter = (tight.displacement(below) - tight.displacement(above))[:, 2].mean()
    model.pretension(below, above, length=shorter)
model.add(end.load((0, 0, 0), moment=(0, MOMENT, 0)))
result = model.solve()

# %%
force = np.array([result.reaction(below)[:, 2].sum() for below, _ in cuts])
print(f"bolts: {(force / 1e3).round(2)} kN")
print(f"loose: up to {4 * MOMENT / (BOLTS * CIRCLE) / 1e3:.2f} kN")
for name, state in (("tight", tight), ("with the moment", result)):
    pressure = -state.stress("node")[at("ring", 0.02), 2] / 1e6
    print(f"joint, {name}: pressure {pressure.min():.1f} … {pressure.max():.1f} MPa")
print(f"moment above the bolts: {result.section(('z', 0.1)).moment[1]:.3f} N m")
print(f"the end turns by {1e6 * end.rotation(result)[1]:.1f} µrad")

# %%
if len(sys.argv) > 1:
    options = {"clip": ((np.sin(np.pi / 48), np.cos(np.pi / 48), 0), 0.0), "view": (-70, 20), "scale": 50}
    result.plot(sys.argv[1], values="szz", clim=(-30e6, 30e6), title="Stress along the bolts", **options)
