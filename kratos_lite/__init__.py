"""kratos_lite: a small, fast and exact finite-element library for solids.

Names are imported when they are first used, so that ``import kratos_lite`` costs little more
than numpy.  See https://en.wikipedia.org/wiki/Finite_element_method for the method and the
``docs`` folder for the library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kratos_lite import ale
    from kratos_lite.analysis import (
        CentralDifference,
        Moment,
        Transient,
        bossak,
        critical_rate,
        generalized_alpha,
        hht,
        material_velocity,
        newmark,
        reaction_resultant,
    )
    from kratos_lite.analysis.model import Model
    from kratos_lite.analysis.result import Result
    from kratos_lite.bodies import (
        BODIES,
        Body,
        Callback,
        FiniteElementBody,
        FixDirection,
        FixPoint,
        FollowerPressure,
        Force,
        Obstacle,
        PrescribedAcceleration,
        PrescribedDisplacement,
        PrescribedVelocity,
        PseudoRigidBody,
        RigidBody,
        RigidLink,
        Spring,
        State,
        TimeSeries,
        Torque,
        convert,
        find_equilibrium,
        march,
    )
    from kratos_lite.elements import (
        ELEMENTS,
        KinematicLinear,
        KinematicLinear3D4N,
        KinematicLinear3D5N,
        KinematicLinear3D6N,
        KinematicLinear3D8N,
        KinematicLinear3D10N,
        KinematicLinear3D13N,
        KinematicLinear3D15N,
        KinematicLinear3D20N,
        KinematicLinear3D27N,
    )
    from kratos_lite.errors import (
        InputError,
        KratosLiteError,
        MaterialError,
        MeshError,
        ModelError,
        SolveError,
    )
    from kratos_lite.io.files import read, write
    from kratos_lite.io.writers.trajectory import Series, trajectory_picture
    from kratos_lite.materials import MATERIALS, Isotropic3D, LinearMaterial, Orthotropic3D
    from kratos_lite.mesh import Block, Mesh, Part
    from kratos_lite.mesh.generators import annulus, box
    from kratos_lite.model.loads import (
        BodyForce,
        Gravity,
        LineLoad,
        NodalForces,
        PointLoad,
        Pressure,
        Timed,
        Traction,
        Varying,
    )
    from kratos_lite.model.mass_properties import MassProperties
    from kratos_lite.shapes import Shape
    from kratos_lite.view import element_picture, picture

__version__ = "0.1.0"

_HOME = {
    "kratos_lite.bodies": (
        "BODIES Body Callback FiniteElementBody FixDirection FixPoint FollowerPressure Force Obstacle "
        "PseudoRigidBody RigidBody RigidLink PrescribedAcceleration PrescribedDisplacement PrescribedVelocity Spring "
        "State TimeSeries Torque convert find_equilibrium march"
    ),
    "kratos_lite.model.mass_properties": "MassProperties",
    "kratos_lite.analysis": (
        "CentralDifference Moment Transient bossak critical_rate generalized_alpha hht material_velocity "
        "newmark reaction_resultant"
    ),
    "kratos_lite.elements": (
        "ELEMENTS KinematicLinear KinematicLinear3D4N KinematicLinear3D5N KinematicLinear3D6N "
        "KinematicLinear3D8N KinematicLinear3D10N KinematicLinear3D13N KinematicLinear3D15N "
        "KinematicLinear3D20N KinematicLinear3D27N"
    ),
    "kratos_lite.errors": "InputError KratosLiteError MaterialError MeshError ModelError SolveError",
    "kratos_lite.mesh.generators": "annulus box",
    "kratos_lite.io.files": "read write",
    "kratos_lite.io.writers.trajectory": "Series trajectory_picture",
    "kratos_lite.model.loads": (
        "BodyForce Gravity LineLoad NodalForces PointLoad Pressure Timed Traction Varying"
    ),
    "kratos_lite.materials": "MATERIALS Isotropic3D LinearMaterial Orthotropic3D",
    "kratos_lite.mesh": "Block Mesh Part",
    "kratos_lite.analysis.model": "Model",
    "kratos_lite.analysis.result": "Result",
    "kratos_lite.shapes": "Shape",
    "kratos_lite.view": "element_picture picture",
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names.split()}
__all__ = [
    "BODIES",
    "ELEMENTS",
    "MATERIALS",
    "Block",
    "Body",
    "BodyForce",
    "Callback",
    "CentralDifference",
    "FiniteElementBody",
    "FixDirection",
    "FixPoint",
    "FollowerPressure",
    "Force",
    "Gravity",
    "InputError",
    "Isotropic3D",
    "KinematicLinear",
    "KinematicLinear3D4N",
    "KinematicLinear3D5N",
    "KinematicLinear3D6N",
    "KinematicLinear3D8N",
    "KinematicLinear3D10N",
    "KinematicLinear3D13N",
    "KinematicLinear3D15N",
    "KinematicLinear3D20N",
    "KinematicLinear3D27N",
    "KratosLiteError",
    "LineLoad",
    "LinearMaterial",
    "MassProperties",
    "MaterialError",
    "Mesh",
    "MeshError",
    "Model",
    "ModelError",
    "Moment",
    "NodalForces",
    "Obstacle",
    "Orthotropic3D",
    "Part",
    "PointLoad",
    "PrescribedAcceleration",
    "PrescribedDisplacement",
    "PrescribedVelocity",
    "Pressure",
    "PseudoRigidBody",
    "Result",
    "RigidBody",
    "RigidLink",
    "Series",
    "Shape",
    "SolveError",
    "Spring",
    "State",
    "TimeSeries",
    "Timed",
    "Torque",
    "Traction",
    "Transient",
    "Varying",
    "__version__",
    "ale",
    "annulus",
    "bossak",
    "box",
    "convert",
    "critical_rate",
    "element_picture",
    "find_equilibrium",
    "generalized_alpha",
    "hht",
    "march",
    "material_velocity",
    "newmark",
    "picture",
    "reaction_resultant",
    "read",
    "trajectory_picture",
    "write",
]


def __getattr__(name: str) -> Any:
    if name == "ale":
        return import_module("kratos_lite.ale")
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'kratos_lite' has no attribute {name!r}")
    value = getattr(import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULE_OF, "ale"})
