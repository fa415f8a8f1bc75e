# %% [markdown]
# # A tumbling box
#
# A box is thrown and tumbles about its middle axis of inertia, which is unstable.  One word makes it rigid,
# pseudo-rigid or finite-element; everything else stays.

# %%
import sys

import kratos_lite as kl

kind = sys.argv[1] if len(sys.argv) > 1 else "finite-element"  # or "rigid", "pseudo-rigid"
mesh = kl.box((0.4, 0.6, 1.0), cells=(2, 3, 5))  # m
rubber = kl.Isotropic3D(E=1e6, nu=0.3, density=1000.0)  # Pa, –, kg/m³

body = kl.BODIES[kind](mesh, rubber)
body.set_velocity(linear=(1.5, 1.5, 4.905), angular=(0.05, 10.0, 0.05))  # m/s, rad/s
body.add(kl.Gravity((0.0, 0.0, -9.81)))  # m/s²

# %% [markdown]
# After one second of free flight the mass center has moved by v t + g t²/2 = (1.5, 1.5, 0) m, and the angular
# momentum is still J ω = (1.36, 232, 0.52) kg m²/s, whatever the body is made of.

# %%
energy, start = body.energy(), kl.State.of(body)
states = [start, *kl.integrate(body, dt=0.002, steps=500, every=10)]
print(body)
print("mass center moved by", (body.mass_center() - mesh.points.mean(axis=0)).round(9), "m")
print("angular momentum", body.angular_momentum().round(9), "kg m²/s")
print(f"energy drift {body.energy() / energy - 1:+.1e}")
print(f"strain energy {body.internal_energy():.3f} J at the end")

# %%
if len(sys.argv) > 2:
    kl.plot(body, sys.argv[2], states=states, title=f"{kind} box", size=(6, 6))
