# %% [markdown]
# # Gravity cube
#
# A cube of 1 m on rollers sinks under its own weight.  The exact displacement of the top is
# -ρ g L² / (2 M) with the confined modulus M = E (1 - ν) / ((1 + ν)(1 - 2ν)): -0.1322 mm.

# %%
import sys

import kratos_lite as kl

soil = kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0)  # Pa (210 N/mm²), –, kg/m³
mesh = kl.box((1.0, 1.0, 1.0), cells=(4, 4, 4), element="KinematicLinear3D27N")  # m

model = kl.Model(mesh, soil)
for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
    model.fix(side, axis)  # rollers
model.add(kl.Gravity((0.0, 0.0, -9.81)))  # m/s²

result = model.solve()

# %%
top = result.displacement("z+")[:, 2].mean()
print(f"top: {top * 1e3:.10f} mm")
print(result)

# %%
if len(sys.argv) > 1:
    result.plot(sys.argv[1], values="uz", view=(30, 20), size=(6, 5))
