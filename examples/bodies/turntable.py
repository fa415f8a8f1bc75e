# A fixed body: nothing pushes it, it turns and moves as it is told.

import numpy as np

import kratos_lite as kl

body = kl.FixedBody(kl.annulus(inner=0.1, outer=1.0, width=0.1, cells=(3, 24, 1)))
body.set_velocity(linear=(0.0, 0.0, 0.1), angular=(0.0, 0.0, np.pi / 2))  # m/s, rad/s

dt, steps, every = 0.01, 100, 10  # s
