"""What bodies and transients offer to writers of series: fields of a state, a row of numbers, arrays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np

from kratos_lite.analysis.fields import FIELDS, fields, listed
from kratos_lite.analysis.quasi_static import QuasiStaticAnalysis
from kratos_lite.analysis.state import State, at, check_state_of_body
from kratos_lite.analysis.transient import TransientAnalysis
from kratos_lite.bodies import Body
from kratos_lite.errors import InputError, ModelError
from kratos_lite.mesh import Mesh
from kratos_lite.typing import Array

OF_BODIES = (
    "time [s]",
    *(f"{name} [J]" for name in ("kinetic energy", "internal energy", "potential energy", "energy")),
    "external work [J]",
    *(f"mass center {axis} [m]" for axis in "xyz"),
    *(f"linear momentum {axis} [kg m/s]" for axis in "xyz"),
    *(f"angular momentum {axis} [kg m2/s]" for axis in "xyz"),
)
"""Columns of a table: energy is the sum of the three before it, angular momentum about the mass center."""
TOTALS = ("time [s]", "energy [J]", "largest displacement [m]")
OF_MODELS = (*TOTALS, *(f"total reaction {axis} [N]" for axis in "xyz"))
"""Columns of a table of a transient."""


class Totals:
    """Energies and momenta of a body, or of many together; their mass center is the mean one."""

    def __init__(self, body: Body) -> None:
        self.time, self.step = body.time, body.step
        energies = body.kinetic_energy(), body.internal_energy(), body.potential_energy()
        self.kinetic, self.internal, self.potential = (float(np.sum(energy)) for energy in energies)
        self.energy = self.kinetic + self.internal + self.potential
        self.work = float(np.sum(body.external_work))
        self.center = body.mass_center().reshape(-1, 3).mean(axis=0)
        momenta = body.linear_momentum(), body.angular_momentum()
        self.linear, self.angular = (momentum.reshape(-1, 3).sum(axis=0) for momentum in momenta)


class RecordedBody:
    """A body, or many as arrays only."""

    columns: tuple[str, ...] = OF_BODIES
    units, kind = "SI", "time"
    names: tuple[str, ...] = ("time", "step", "q", "u", "external_work")

    def __init__(self, body: Body, path: str | Path) -> None:
        self.body, self.path, self.extra = body, path, {"kind": np.array(body.kind)}

    def now(self) -> State:
        """Return the state of the body as it is now."""
        return State.of(self.body)

    def checked(self, state: Any) -> State:
        """Return a state of the body; InputError for another."""
        return check_state_of_body(state, self.body)

    def mesh(self) -> Mesh:
        """Return the mesh; ModelError for a body without one."""
        check_single(self.body, self.path)
        if self.body.mesh is None:
            raise ModelError(f"{self.path}: this body has no mesh to be shown; write .csv or .npz")
        return self.body.mesh

    def fields(self, state: State) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return DISPLACEMENT and VELOCITY of the nodes."""
        X = self.mesh().points
        with at(self.body, state):
            moved = self.body.position(X) - X
            values = {"displacement": moved, "velocity": self.body.velocity(X)}
            return {FIELDS[name].kratos: value for name, value in values.items()}, {}

    def at_nodes(self, state: State, names: Iterable[str] = ()) -> dict[str, Array]:
        """Return displacements and velocities of the nodes by CalculiX's names, whatever is requested."""
        return dict(zip(("DISP", "VELO"), self.fields(state)[0].values(), strict=True))

    def row(self, state: State) -> Array:
        """Return time, energies, work, mass center and momenta."""
        check_single(self.body, self.path)
        with at(self.body, state):
            now = Totals(self.body)
        energies = now.kinetic, now.internal, now.potential, now.energy
        work = float(state.external_work)
        return np.array([state.time, *energies, work, *now.center, *now.linear, *now.angular])


class RecordedModel:
    """A transient of a model."""

    columns: tuple[str, ...] = OF_MODELS
    kind = "time"
    names: tuple[str, ...] = ("time", "step", "u", "v", "a", "reactions")
    extra: ClassVar[dict[str, Array]] = {}

    def __init__(self, transient: Any) -> None:
        self.transient, self.now, self.checked = transient, transient.state, transient.check_state
        self.units = self.mesh().units

    def mesh(self) -> Mesh:
        """Return the mesh of the model."""
        mesh: Mesh = self.transient.model.mesh
        return mesh

    def fields(self, state: Any) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return DISPLACEMENT, VELOCITY, ACCELERATION, REACTION and stresses."""
        points, cells = fields(self.transient.result(state))
        return points | {field.kratos: field.at(state) for field in listed("state").values()}, cells

    def at_nodes(self, state: Any, names: Iterable[str] | None = None) -> dict[str, Array]:
        """Return fields of nodes by CalculiX's names, all if not given, and displacements and velocities."""
        from kratos_lite.io.writers.calculix import ALL, at_nodes, displacements  # rarely needed

        result = self.transient.result(state)
        fields = {"DISP": state.u, **({"VELO": state.v} if self.kind == "time" else {})}
        fields |= at_nodes(result, ALL if names is None else names)
        fields["DISP"] = displacements(self.transient.model, state.u, state.time)
        if self.kind == "time" and not result.is_linear:
            fields.pop("FORC", None)  # internal forces are those of supports and loads at rest alone
        return fields

    def row(self, state: Any) -> Array:
        """Return time, energy, largest displacement and total reaction."""
        largest = np.linalg.norm(state.u, axis=1).max()
        reaction = state.reactions.sum(axis=0)
        return np.array([state.time, self.transient.energy(state), largest, *reaction])


class RecordedSteps(RecordedModel):
    """Quasi-static steps of a model."""

    columns: tuple[str, ...] = ("time [s]", "work [J]", *OF_MODELS[2:])
    kind = "static"
    names: tuple[str, ...] = ("time", "step", "u", "reactions", "work")

    def fields(self, state: Any) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return DISPLACEMENT, REACTION and stresses."""
        return fields(self.transient.result(state))

    def row(self, state: Any) -> Array:
        """Return time, work of loads and supports, largest displacement and total reaction."""
        largest = np.linalg.norm(state.u, axis=1).max()
        return np.array([state.time, state.work, largest, *state.reactions.sum(axis=0)])


Recorded: TypeAlias = "RecordedBody | RecordedModel"
"""What is recorded of a subject in time; its `names` of arrays are attributes of a state."""


def recorded(subject: Body | TransientAnalysis | QuasiStaticAnalysis, path: str | Path) -> Recorded:
    """Return what a subject offers; InputError for one that is no body and no model in time."""
    if isinstance(subject, TransientAnalysis):
        return RecordedModel(subject)
    if isinstance(subject, QuasiStaticAnalysis):
        return RecordedSteps(subject)
    if isinstance(subject, Body):
        return RecordedBody(subject, path)
    raise InputError(
        f"{path}: a series holds the states of one body, such as kl.RigidBody, or of a transient; "
        f"got {type(subject).__name__}; make one series for each body"
    )


def check_single(body: Body, path: str | Path) -> None:
    """Raise ModelError for a batch of bodies."""
    if body.q.ndim > 1:
        raise ModelError(f"{path}: only a single body can be written so; write batches of bodies as .npz")


def arrays_of(subject: Recorded, states: Sequence[Any]) -> dict[str, Array]:
    """Return the numbers of states as arrays, one row for each state."""
    arrays = {name: np.array([getattr(state, name) for state in states]) for name in subject.names}
    return {**subject.extra, **arrays}
