# %% [markdown]
# # A pulse in a moving frame
#
# A frame of 20 m moves with 0.4 c along an endless bar.  A bump of 1 mm that is let go splits into two
# waves: seen from the frame one is slow, the other fast.  Both leave through absorbing boundaries.

# %%
import sys

import numpy as np

import kratos_lite as kl

bar = kl.box((20.0, 1.0, 1.0), cells=(100, 1, 1), origin=(-10.0, 0.0, 0.0))  # m
soil = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)  # Pa, –, kg/m³
c = np.sqrt(soil.C[0, 0] / soil.density)  # m/s, of pressure waves; the bar does not widen
rate = 0.4 * c

model = kl.Model(bar, soil)
model.fix(range(bar.n_nodes), "yz")
model.add(kl.ale.Translation("x", rate, boundaries="absorbing"))


def bump(x):
    """Return the displacement of the bump in m at x in m."""
    return 1e-3 * np.exp(-((x / 0.8) ** 2) / 2)


x = bar.points[:, 0]
u, v = np.zeros((2, bar.n_nodes, 3))
u[:, 0] = bump(x)
v[:, 0] = -rate * x / 0.8**2 * bump(x)  # the material is at rest: u' = rate du/dx
transient = model.transient(displacement=u, velocity=v)
fastest = np.abs(transient.material_velocity()).max()
print(f"u' at first {np.abs(v).max() * 1e3:.1f} mm/s, of the material {fastest * 1e3:.2f} mm/s")

# %%
moments = [transient.state(), *kl.integrate(transient, dt=0.0004, steps=400, every=50)]
for moment in moments[::2]:
    place = x + rate * moment.time  # along the bar
    exact = (bump(place - c * moment.time) + bump(place + c * moment.time)) / 2
    wrong = np.abs(moment.u[:, 0] - exact).max() / 1e-3
    print(f"t = {moment.time:.2f} s: largest {moment.u[:, 0].max() * 1e3:.4f} mm, wrong by {wrong:.1e}")
print(f"energy left {transient.energy() / transient.energy(moments[0]):.1e}")

# %% [markdown]
# One picture: the bar at all moments side by side, its displacement along x drawn upwards.

# %%
if len(sys.argv) > 1:
    count, block = len(moments), bar.blocks[0]
    points = np.vstack([bar.points + np.array((0, 2.0 * k, 0)) for k in range(count)])
    nodes = np.vstack([block.nodes + k * bar.n_nodes for k in range(count)])
    ids = np.arange(1, len(nodes) + 1)
    mesh = kl.Mesh(points, [kl.Block(block.name, nodes, ids, np.ones_like(ids), block.shape)])
    along = np.concatenate([moment.u[:, 0] for moment in moments])
    upward = np.outer(along, (0, 0, 1))
    title = f"Displacement along the bar drawn upwards, {moments[1].time:g} s from one to the next"
    drawn = {"displacement": upward, "scale": 3000, "values": along, "unit": "m"}
    kl.plot(mesh, sys.argv[1], **drawn, title=title, view="iso", size=(6, 4))
