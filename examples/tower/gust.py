# A gust of two seconds on a tower of 20 m: a script with a case for the command line.
#
#     kratos-lite solve examples/tower/gust.py -o swing.csv

from pathlib import Path

import kratos_lite as kl

mesh = kl.read(Path(__file__).with_name("tower.mdpa")).mesh
tower = kl.Model(mesh, kl.Isotropic3D(E=30e9, nu=0.2, density=2500.0))  # Pa, –, kg/m³
tower.fix("z-")
gust = kl.TimeSeries(times=[0.0, 0.01, 2.0, 2.01], values=[0.0, 1.0, 1.0, 0.0])  # s
tower.add(kl.Pressure("x-", 1e3), amplitude=gust)  # Pa

case = kl.Case(
    tower,
    kl.TimeIntegration(step=0.005, steps=800, every=4, integrator=kl.HHT(-0.05), rayleigh=(0.3, 0.001)),
)
