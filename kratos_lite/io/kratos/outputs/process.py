"""OutputProcess: files with values of a part of a model after some steps."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from kratos_lite.errors import nearest
from kratos_lite.io.case import Case, StepOutput
from kratos_lite.io.kratos.context import RunContext, part_of
from kratos_lite.io.kratos.outputs.values import gauss_variables, nodal_variables
from kratos_lite.io.settings import Settings, inside
from kratos_lite.io.writers.series import make_folder
from kratos_lite.mesh import Mesh, Part, ids_of


class OutputProcess(StepOutput):
    """An output process with its parameters."""

    keys: tuple[str, ...] = ()  # parameters beside those of all and those below
    nodal: tuple[str, ...] = ("output_variables",)  # lists of variables at nodes
    gauss: tuple[str, ...] = ()  # lists of variables at Gauss points
    note = ""  # on what is written otherwise than in Kratos
    absent: tuple[str, ...] = ()  # parameters of what kratos_lite does not have, unless empty or false

    def __init__(self, settings: Settings, context: RunContext) -> None:
        settings.check_keys([*self.words(), *self.absent])
        for key in self.absent:
            text = f"{key} is not supported; leave it out"
            settings.expect(not settings.values.get(key), key, text)
        self.settings, self.context = settings, context
        self.part_name = context.part_name(settings)
        self.steps = self.due()
        self.times = [context.times[step] for step in self.steps]
        self.end = context.times[-1]
        self.written: dict[str, None] = {}  # the files so far

    @classmethod
    def words(cls) -> list[str]:
        """Return the keys of its parameters."""
        return ["help", "mesh_id", "model_part_name", *cls.keys, *cls.nodal, *cls.gauss]

    @abstractmethod
    def due(self) -> list[int]:
        """Return the steps after which it writes."""

    def known(self, case: Case) -> dict[str, list[str]]:
        """Return the variables that results have for each list of them."""
        at_points = [*gauss_variables(case.model.element_groups())]
        return dict.fromkeys(self.nodal, nodal_variables(case)) | dict.fromkeys(self.gauss, at_points)

    def check(self, case: Case) -> None:
        """Raise InputError for a variable that the results do not have, with the nearest name."""
        for key, have in self.known(case).items():
            place = "nodes" if key in self.nodal else "Gauss points"
            for name in self.settings.texts(key):
                text = f"kratos_lite has no {name} at {place} here.{nearest(name, have)} There are "
                self.settings.expect(name in have, key, text + ", ".join(have))

    def word(self, key: str, *known: str) -> str:
        """Return one of some words, the first if none is given."""
        word = self.settings.text(key, known[0])
        self.settings.expect(word in known, key, f"must be {' or '.join(known)}; got {word!r}")
        return word

    def require_historical(self) -> None:
        """Raise InputError for values of nodes that Kratos keeps without history."""
        text = "kratos_lite has historical values of nodes only; leave it out"
        self.settings.expect(self.settings.flag("historical_value", True), "historical_value", text)

    def step_at(self, time: float) -> int:
        """Return the step that ends at a time."""
        return self.steps[int(np.argmin(np.abs(np.array(self.times) - time)))]

    def part(self, mesh: Mesh, name: str | None = None) -> Part:
        """Return the part, or another, in the mesh of a result, nodes and cells in the order of ids."""
        part = part_of(mesh, self.part_name if name is None else name)
        ids = {"nodes": mesh.node_ids, "elements": mesh.element_ids, "conditions": ids_of(mesh.conditions)}
        rows = {what: getattr(part, what) for what in ids}
        return Part(**{what: at[np.argsort(ids[what][at])] for what, at in rows.items()})

    def begin(self, path: str) -> None:
        """Make the folder of a file that is written now."""
        make_folder(path)
        self.written[path] = None

    def summary(self) -> list[str]:
        """Return the written files, many as the first and the last of them."""
        paths = list(self.written)
        if not paths:
            return [f"nothing for {self.settings.path}: no step at its times was taken"]
        return paths if len(paths) < 4 else [f"{paths[0]} … {paths[-1]} ({len(paths)} files)"]

    def path(self, name: str, key: str) -> str:
        """Return the path of a file that is named from the folder of the run file."""
        return str(self.settings.placed(key, inside, self.context.folder, name, self.context.outside))
