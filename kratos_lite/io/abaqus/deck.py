"""A deck: its cards, one by one, and the cases that its steps are."""

from __future__ import annotations

from collections.abc import Callable, Collection
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kratos_lite.errors import InputError, naming, nearest
from kratos_lite.io.abaqus.cards import Card, read_cards
from kratos_lite.io.abaqus.couplings import Connections
from kratos_lite.io.abaqus.loads import OPTIONS, Acting, read_rows
from kratos_lite.io.abaqus.materials import Axes, Definition, axes_of, orientation
from kratos_lite.io.abaqus.mesh import Geometry
from kratos_lite.model.local_axes import LocalAxes
from kratos_lite.time_series import TimeSeries
from kratos_lite.typing import Array

NO_EFFECT = frozenset(
    "HEADING PREPRINT RESTART CONTROLS CONDUCTIVITY SPECIFICHEAT FILTER "
    "TIMEPOINTS PHYSICALCONSTANTS SURFACEINTERACTION SURFACEBEHAVIOR FRICTION GAPCONDUCTANCE "
    "CONTACTDAMPING CONTACTFILE".split()
)
"""Cards that change nothing in the displacements of solids, or nothing by themselves."""
_REFUSED = {
    "contact": "CONTACTPAIR CONTACTPRINT GAP CLEARANCE",
    "shells and membranes": "SHELLSECTION MEMBRANESECTION",
    "beams": "BEAMSECTION BEAMGENERALSECTION",
    "heat transfer": "HEATTRANSFER COUPLEDTEMPERATURE-DISPLACEMENT UNCOUPLEDTEMPERATURE-DISPLACEMENT "
    "CFLUX DFLUX FILM RADIATE",
    "flow": "FLUIDSECTION FLUIDCONSTANTS CFD",
    "cyclic symmetry": "CYCLICSYMMETRYMODEL SELECTCYCLICSYMMETRYMODES",
    "this law": "CREEP VISCO CYCLICHARDENING DEFORMATIONPLASTICITY HYPERFOAM CHANGEPLASTIC CHANGEMATERIAL",
    "a law in Fortran": "USERMATERIAL DEPVAR",
    "optimization": "SENSITIVITY DESIGNVARIABLES OBJECTIVE",
    "a substructure": "SUBSTRUCTUREGENERATE SUBMODEL",
    "a change of the model": "MODELCHANGE CHANGESOLIDSECTION",
    "this card": "DASHPOT MPC COMPLEXFREQUENCY GREEN",
}
REFUSED = {keyword: what for what, keywords in _REFUSED.items() for keyword in keywords.split()}
"""What cards stand for that are refused."""
OF_MESH = {
    "NODE": Geometry.node, "ELEMENT": Geometry.element, "SURFACE": Geometry.surface,
    "NSET": Geometry.named_set, "ELSET": Geometry.named_set,
}  # fmt: skip
OF_MATERIAL = {
    "ELASTIC": ("TYPE",), "DENSITY": (), "EXPANSION": ("TYPE", "ZERO"), "PLASTIC": ("HARDENING",),
    "HYPERELASTIC": ("NEOHOOKE", "MOONEY-RIVLIN", "OGDEN", "N", "MODULI"), "DAMPING": ("ALPHA", "BETA"),
}  # fmt: skip
"""Cards after *MATERIAL, and their options."""
PROCEDURES = {
    "STATIC": ("SOLVER", "DIRECT"),
    "FREQUENCY": ("SOLVER", "STORAGE", "GLOBAL"),
    "BUCKLE": ("SOLVER",),
    "DYNAMIC": ("SOLVER", "DIRECT", "ALPHA"),
    "MODALDYNAMIC": ("SOLVER", "DIRECT", "DELTMX"),
    "STEADYSTATEDYNAMICS": ("SOLVER", "HARMONIC"),
}
"""Kinds of steps, and their options."""
FILES = ("NODEFILE", "ELFILE", "NODEOUTPUT", "ELEMENTOUTPUT")
_ALL = ("FREQUENCY", "FREQUENCYF")
OUTPUTS = {
    **dict.fromkeys(FILES, (*_ALL, "GLOBAL", "NSET", "OUTPUT", "POSITION", "LASTITERATIONS")),
    "NODEPRINT": (*_ALL, "GLOBAL", "TOTALS", "NSET"), "ELPRINT": (*_ALL, "GLOBAL", "TOTALS", "ELSET"),
    **dict.fromkeys(("SECTIONPRINT", "FACEPRINT"), (*_ALL, "SURFACE", "NAME")), "OUTPUT": _ALL,
}  # fmt: skip
"""Cards that ask for results, and their options."""


@dataclass
class Step:
    """A step: what it asks for, and the supports and loads at its end."""

    card: Card
    large: bool  # NLGEOM
    start: float  # total time at which it begins
    procedure: Card | None = None
    damping: Card | None = None  # *MODAL DAMPING
    outputs: list[Card] = field(default_factory=list)
    amplitudes: list[TimeSeries] = field(default_factory=list)  # over its time
    acting: Acting = field(init=False)

    @property
    def kind(self) -> str:
        """Its procedure, such as STATIC."""
        return self.procedure.keyword if self.procedure else ""

    def numbers(self) -> list[float]:
        """Return the numbers of its data line, or none."""
        row = next(self.procedure.rows(), None) if self.procedure else None
        return [row.number(i, 0.0) for i in range(len(row.fields))] if row else []

    @property
    def is_direct(self) -> bool:
        """Whether its increments are those given."""
        options = self.procedure.options if self.procedure else {}
        return options.get("DIRECT", "YES" if self.kind == "MODALDYNAMIC" else "NO").upper() != "NO"

    @property
    def period(self) -> float:
        """Its duration; 0 of modes and the like, which take no time."""
        numbers = [*self.numbers(), 1.0, 1.0] if len(self.numbers()) != 1 else [1.0, 1.0]
        return numbers[1] if self.kind in ("STATIC", "DYNAMIC", "MODALDYNAMIC") else 0.0

    @property
    def ends(self) -> list[float]:
        """Its amplitudes at its end."""
        return [series(self.period) for series in self.amplitudes]

    @property
    def ramps(self) -> bool:
        """Whether what has no amplitude grows over the step, in place of acting at once."""
        default = "RAMP" if self.kind == "STATIC" else "STEP"
        return self.card.options.get("AMPLITUDE", default).upper() == "RAMP"

    @property
    def perturbs(self) -> bool:
        """Whether it begins from the stresses of the steps before it."""
        return "PERTURBATION" in self.card.options


class Deck:
    """What the cards of a deck have said so far."""

    def __init__(self, path: Path) -> None:
        self.path, self.geometry = path, Geometry()
        cards, self.notes = list(read_cards(path)), self.geometry.notes
        for card in cards:
            if card.keyword in OF_MESH:
                OF_MESH[card.keyword](self.geometry, card)
            elif card.keyword in ("RIGIDBODY", "COUPLING"):
                self.geometry.reference(card)
        with naming(str(path)):
            cuts = [card for card in cards if card.keyword == "PRE-TENSIONSECTION"]
            self.geometry.build(path.name)
            self.connections = Connections(self.geometry, cuts)
        self.mesh, n = self.geometry.mesh, self.geometry.mesh.n_nodes
        self.materials = dict[str, Definition]()
        self.sections = list[tuple[str, str, str, Card]]()  # ELSET, MATERIAL, ORIENTATION
        self.orientations = dict[str, LocalAxes]()
        self.amplitudes = dict[str, TimeSeries]()
        self.in_total_time = set[str]()  # amplitudes
        self.start = dict[str, Array]()  # DISPLACEMENT and VELOCITY (n, 3) at the beginning
        self.stresses = list[Card]()  # at the beginning
        lines = sum(card.data.count(b"\n") for card in cards if card.keyword == "DLOAD")
        self.acting = Acting(n, self.mesh.n_elements, lines + 1)  # a line is a body at most
        self.axes = self.connections.axes = Axes(np.full(n, -1))
        self.initial = np.zeros(n)  # temperatures
        self.steps = list[Step]()
        self.open: Step | None = None  # the step that is being read
        self._given = set[str]()  # kinds of supports and loads in it
        self._material: Definition | None = None
        self._read([card for card in cards if card.keyword not in OF_MESH])

    def _read(self, cards: list[Card]) -> None:
        """Read all cards but those of the mesh."""
        ignored = set[str]()
        for card in cards:
            keyword = card.keyword
            if keyword in REFUSED:
                card.wrong(f"{REFUSED[keyword]} is not supported")
            if keyword in OF_MATERIAL:
                self._of_material(card)
                continue
            if keyword in NO_EFFECT:
                if "READ" in card.options:
                    card.wrong("a start from the state of another job is not supported")
                ignored.add(keyword)
                continue
            self._material = None
            if keyword not in CARDS:
                known = (*CARDS, *OF_MESH, *NO_EFFECT, *OF_MATERIAL)
                card.wrong(f"this card is not known.{nearest(keyword, known)}")
            with naming(card.place):
                CARDS[keyword](self, card)
        if self.open is not None:
            self.open.card.wrong("the step is not ended by *END STEP")
        if ignored:
            self.notes.append(f"cards without effect here: {', '.join(sorted(ignored))}")

    def _of_material(self, card: Card) -> None:
        if self._material is None:
            card.wrong("it belongs after *MATERIAL")
        card.check_options(OF_MATERIAL[card.keyword])
        if (old := self._material.cards.get(card.keyword)) is not None:
            self.notes.append(f"{card.place}: *{card.keyword} replaces that of {old.place}")
        self._material.cards[card.keyword] = card

    # ---- the model ------------------------------------------------------------------------------------

    def material(self, card: Card) -> None:
        """Read *MATERIAL."""
        card.check_options(("NAME",))
        self._material = self.materials[_new_name(card, self.materials)] = Definition(card)

    def section(self, card: Card) -> None:
        """Read *SOLID SECTION."""
        card.check_options(("ELSET", "MATERIAL", "ORIENTATION"))
        names = [card.option(name, "").upper() for name in ("ELSET", "MATERIAL", "ORIENTATION")]
        self.sections.append((names[0], names[1], names[2], card))

    def orientation(self, card: Card) -> None:
        """Read *ORIENTATION."""
        self.orientations[_new_name(card, self.orientations)] = orientation(card)

    def amplitude(self, card: Card) -> None:
        """Read *AMPLITUDE, pairs of a time and a factor."""
        card.check_options(("NAME", "TIME", "DEFINITION"))
        if card.option("DEFINITION", "TABULAR").upper() != "TABULAR":
            card.wrong("DEFINITION=TABULAR alone is supported")
        pairs = card.every()
        if pairs.size % 2 or not pairs.size:
            card.wrong(f"times and factors come in pairs; got {pairs.size} numbers")
        name = _new_name(card, self.amplitudes)
        try:
            self.amplitudes[name] = TimeSeries(pairs[::2], pairs[1::2])
        except InputError as error:
            card.wrong(str(error))
        if card.option("TIME", "STEP TIME").upper().startswith("TOTAL"):
            self.in_total_time.add(name)

    def transform(self, card: Card) -> None:
        """Read *TRANSFORM."""
        card.check_options(("NSET", "TYPE"))
        rows = self.geometry.nodes(card.option("NSET"), card)
        line = next(card.rows(), None) or card.wrong("two points are needed on its data line")
        self.axes.each.append(axes_of(line, card.option("TYPE", "R")))
        self.axes.of_node[rows] = len(self.axes.each) - 1

    def initial_conditions(self, card: Card) -> None:
        """Read *INITIAL CONDITIONS."""
        card.check_options(("TYPE",))
        kind, mesh = card.option("TYPE").upper(), self.mesh
        if kind == "STRESS":
            self.stresses.append(card)
        elif kind == "TEMPERATURE":
            for row in card.rows():
                self.initial[self.geometry.nodes(row.text(0), row)] = row.number(1)
        elif kind in ("DISPLACEMENT", "VELOCITY"):
            field = self.start.setdefault(kind, np.zeros((mesh.n_nodes, 3)))
            for row in card.rows():
                if (axis := row.integer(1)) not in (1, 2, 3):
                    row.wrong(f"directions are 1, 2 and 3; got {axis}")
                field[self.geometry.nodes(row.text(0), row), axis - 1] = row.number(2)
        else:
            card.wrong(f"TYPE={kind} is not supported; TEMPERATURE, STRESS, DISPLACEMENT and VELOCITY are")

    def connection(self, card: Card) -> None:
        """Read a card that connects nodes."""
        getattr(self.connections, card.keyword.lower())(card)

    # ---- steps ----------------------------------------------------------------------------------------

    def step(self, card: Card) -> None:
        """Read *STEP."""
        card.check_options(("NLGEOM", "INC", "PERTURBATION", "AMPLITUDE", "NAME"))
        if self.open is not None:
            card.wrong(f"the step of {self.open.card.place} is not ended by *END STEP")
        if card.options.get("AMPLITUDE", "RAMP").upper() not in ("RAMP", "STEP"):
            card.wrong("AMPLITUDE is RAMP or STEP")
        # Rubber and an earlier step turn NLGEOM on, as in CalculiX.
        large = any(step.large for step in self.steps[-1:])
        large |= any("HYPERELASTIC" in material.cards for material in self.materials.values())
        if "NLGEOM" in card.options:
            large = card.options["NLGEOM"].upper() != "NO"
        start = sum(step.period for step in self.steps)
        self.open = Step(card, large, start)
        self._given.clear()

    def procedure(self, card: Card) -> None:
        """Read the kind of a step, such as *STATIC, and its data line."""
        step = self._in_step(card)
        if step.procedure is not None:
            card.wrong(f"the step has *{step.procedure.keyword} already; write another *STEP")
        card.check_options(PROCEDURES[card.keyword])
        if step.perturbs and card.keyword != "FREQUENCY":
            step.card.wrong(f"PERTURBATION is supported with *FREQUENCY; got *{card.keyword}")
        step.procedure = card
        if card.keyword == "BUCKLE":  # under its own loads alone
            self.acting.clear(*(self.acting.keys() - {"BOUNDARY"}))

    def modal_damping(self, card: Card) -> None:
        """Read *MODAL DAMPING."""
        card.check_options(("RAYLEIGH",))
        self._in_step(card).damping = card

    def act(self, card: Card) -> None:
        """Read a card of supports or loads."""
        kind = card.keyword.replace("DSLOAD", "DLOAD")
        if kind != "BOUNDARY" and self._in_step(card).procedure is None:
            card.wrong("it belongs after the procedure of the step, such as *STATIC")
        card.check_options(("OP", "AMPLITUDE", *OPTIONS[card.keyword]))
        if "FIXED" in card.options:
            card.wrong("option FIXED is not supported; give the value")
        if (op := card.options.get("OP", "MOD").upper()) not in ("NEW", "MOD"):
            card.wrong(f"OP is NEW or MOD; got {op}")
        if op == "NEW" and kind in self._given:
            self.notes.append(f"{card.place}: OP=NEW counts on the first *{kind} of a step alone")
        elif op == "NEW":
            self.acting.clear(kind, *{"CLOAD": ["IMAGINARY"], "DLOAD": ["BODIES"]}.get(kind, ()))
        self._given.add(kind)
        known, name = ["", *self.amplitudes], card.options.get("AMPLITUDE", "").upper()
        if name not in known:
            card.wrong(f"there is no *AMPLITUDE {name}.{nearest(name, self.amplitudes)}")
        read_rows(card, self.acting, self.geometry, known.index(name), len(self.steps) + 1)

    def output(self, card: Card) -> None:
        """Read a card that asks for results."""
        card.check_options(OUTPUTS[card.keyword])
        if card.keyword in FILES and card.options.get("GLOBAL", "YES").upper() == "NO":
            card.wrong("GLOBAL=NO is not supported in files; *NODE PRINT and *EL PRINT have local axes")
        if (place := card.options.get("POSITION", "NODES").upper()) not in ("NODES", "AVERAGED AT NODES"):
            card.wrong(f"POSITION={place} is not supported; files have values AVERAGED AT NODES")
        self._in_step(card).outputs.append(card)

    def end_step(self, card: Card) -> None:
        """Read *END STEP."""
        step = self._in_step(card)
        if step.procedure is None:
            step.card.wrong("the step has no procedure such as *STATIC")
        if "IMAGINARY" in self.acting and step.kind != "STEADYSTATEDYNAMICS":
            step.card.wrong(f"LOAD CASE=2 belongs to *STEADY STATE DYNAMICS; got *{step.kind}")
        step.acting = deepcopy(self.acting)
        step.amplitudes = [
            TimeSeries(series.times - step.start * (name in self.in_total_time), series.values)
            for name, series in self.amplitudes.items()
        ]
        self.steps.append(step)
        self.open = None
        # What a later step does not give again keeps the value that it has at the end of this one.
        goes_on = [name in self.in_total_time for name in self.amplitudes]
        self.acting.settle(np.where(goes_on, np.nan, step.ends))

    def _in_step(self, card: Card) -> Step:
        if self.open is None:
            card.wrong("it belongs between *STEP and *END STEP")
        return self.open


def _new_name(card: Card, known: Collection[str]) -> str:
    """Return the name that a card gives; InputError where another has it."""
    name = card.option("NAME").upper()
    return card.wrong(f"the name {name} is taken; choose another") if name in known else name


CARDS: dict[str, Callable[[Deck, Card], None]] = {
    "MATERIAL": Deck.material, "SOLIDSECTION": Deck.section, "ORIENTATION": Deck.orientation,
    "AMPLITUDE": Deck.amplitude, "TRANSFORM": Deck.transform, "INITIALCONDITIONS": Deck.initial_conditions,
    "MODALDAMPING": Deck.modal_damping,
    "STEP": Deck.step, "ENDSTEP": Deck.end_step,
    **dict.fromkeys(PROCEDURES, Deck.procedure),
    "PRE-TENSIONSECTION": lambda deck, card: None,  # read with the mesh
    **dict.fromkeys("RIGIDBODY COUPLING KINEMATIC DISTRIBUTING".split(), Deck.connection),
    **dict.fromkeys("DISTRIBUTINGCOUPLING TIE SPRING MASS EQUATION".split(), Deck.connection),
    **dict.fromkeys(OPTIONS, Deck.act),
    **dict.fromkeys(OUTPUTS, Deck.output),
}  # fmt: skip
"""What reads each card."""
