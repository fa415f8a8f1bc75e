"""Bodies in motion: rigid, pseudo-rigid and finite-element, with one protocol for all.

Source: Solfec-1.0, theory manual.
"""

from kratos_lite.bodies.body import BODIES as BODIES
from kratos_lite.bodies.body import Body as Body
from kratos_lite.bodies.constraints import Constraint as Constraint
from kratos_lite.bodies.constraints import FixDirection as FixDirection
from kratos_lite.bodies.constraints import FixPoint as FixPoint
from kratos_lite.bodies.constraints import PrescribedAcceleration as PrescribedAcceleration
from kratos_lite.bodies.constraints import PrescribedDisplacement as PrescribedDisplacement
from kratos_lite.bodies.constraints import PrescribedVelocity as PrescribedVelocity
from kratos_lite.bodies.constraints import RigidLink as RigidLink
from kratos_lite.bodies.conversion import convert as convert
from kratos_lite.bodies.equilibrium import find_equilibrium as find_equilibrium
from kratos_lite.bodies.finite_element import FiniteElementBody as FiniteElementBody
from kratos_lite.bodies.loads import Callback as Callback
from kratos_lite.bodies.loads import FollowerPressure as FollowerPressure
from kratos_lite.bodies.loads import Force as Force
from kratos_lite.bodies.loads import Spring as Spring
from kratos_lite.bodies.loads import Torque as Torque
from kratos_lite.bodies.pseudo_rigid import PseudoRigidBody as PseudoRigidBody
from kratos_lite.bodies.rigid import FixedBody as FixedBody
from kratos_lite.bodies.rigid import RigidBody as RigidBody
from kratos_lite.time_series import TimeSeries as TimeSeries
