"""Let Kratos divide `.mdpa` files by METIS: ``python kratos_parts_driver.py RANKS FILE …``.

Each FILE gives ``NAME_partitioned/NAME_R.mdpa`` in its folder.  No MPI is needed: one process divides.
"""

import os
import sys
from pathlib import Path

import KratosMultiphysics as KM
import KratosMultiphysics.StructuralMechanicsApplication
from KratosMultiphysics import MetisApplication as Metis

DIMENSION, VERBOSITY, CONDITIONS_WITH_ELEMENTS = 3, 0, True

for file in map(Path, sys.argv[2:]):
    os.chdir(file.parent)
    io = KM.ModelPartIO(file.stem, KM.IO.READ | KM.IO.SKIP_TIMER)
    Metis.MetisDivideHeterogeneousInputProcess(
        io, int(sys.argv[1]), DIMENSION, VERBOSITY, CONDITIONS_WITH_ELEMENTS
    ).Execute()
