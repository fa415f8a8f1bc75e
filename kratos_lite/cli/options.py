"""The options of ``solve`` and ``check``: a new one is a row here, its effect stands in `apply_options`."""

from __future__ import annotations

from argparse import Namespace
from typing import Any, NamedTuple

from kratos_lite.errors import InputError, KratosLiteError

BACKEND = "petsc: statics, by PETSc over all processes that mpirun or srun has started (own, on one)"
BOUNDARIES = "condition on the cut faces of the moving frame (absorbing)"
ERROR = "relative error of the energy norm below 1, such as 1%% or 0.01: statics, the mesh made finer"
BUCKLING = "find the N lowest factors of the loads at which the model buckles; files as for --modes"
FORMULATION = (
    "instead of that of the names of elements: standard, enhanced, b_bar, reduced, "
    "total_lagrangian, f_bar or non_locking"
)
HARMONIC = "find the response to loads that swing, at frequencies in Hz with a damping ratio (0); -o OUT.csv"
INTEGRATOR = (
    "newmark[:BETA,GAMMA], hht[:ALPHA], bossak[:ALPHA], generalized_alpha[:RHO] or central_difference"
)
MODES = "find the N lowest natural frequencies instead; modes go to -o OUT.pvd, .html or .frd, and --picture"
OUTPUT = (
    "static: .vtu (ParaView), .html (browser), .vtk, .json, .csv (nodes), .pvtu (many processes); in time: "
    ".pvd, .html, .csv, .npz; of modes: .pvd, .html; of all: .frd (CalculiX); may be given several times"
)
PICTURE = "picture of the deformed model, of its modes, or of a body along its path; .gif, .mp4: film"
REMOTE = "PART:POINT:FORCE[,MOMENT]"
RESTART = "go on from a state that --state wrote; files hold the rest alone, so give them new names"
STRESS_FREE = "do not take the DISPLACEMENT of free nodes in the file for the state without stress"
SECTION = "force, moment and area of a cut: by a plane, x=0.5 or BOLT:x=0.5 of one part, or around a part"
UNITS = "consistent units of all numbers here and in the file, a label: auto, mm N MPa t … (SI)"
VTU = "how .vtu files store their numbers: fastest, smallest, or readable by eye (binary)"


class Option(NamedTuple):
    """One option."""

    names: str  # such as ``-o --output``
    form: str | None  # of its value: one of `FORMS`, choices with a | between, any text; None of a switch
    help: str
    many: bool = False  # whether it may be given several times
    only: str = ""  # the cases that have it: models, time, statics
    needs: tuple[str, ...] = ()  # options of which one must be given, too

    @property
    def name(self) -> str:
        """Its long name."""
        return self.names.split()[-1]

    @property
    def dest(self) -> str:
        """Its attribute of a namespace."""
        return self.name[2:].replace("-", "_")

    def value_of(self, text: str) -> Any:
        """Return what a text means; InputError, with the name of the option, if it means nothing."""
        from kratos_lite.cli.values import read  # help and version do without it

        try:
            return read(self.form or "", text)
        except KratosLiteError as error:
            raise InputError(f"{self.name}: {error}") from None
        except ValueError:
            meaning = self.help.replace("%%", "%")
            raise InputError(f"{self.name}: expected {self.form} ({meaning}); got {text!r}") from None


def _all(*options: Option, **columns: Any) -> tuple[Option, ...]:
    """Return options that have columns in common."""
    return tuple(option._replace(**columns) for option in options)


GROUPS = {
    "output (instead of the files that the input names)": (
        Option("-o --output", "OUT", OUTPUT, many=True),
        Option(
            "--json",
            "OUT.json",
            "summary, displacements and reactions by node id; of modes their frequencies",
        ),
        Option("--picture", "OUT.png", PICTURE),
        Option(
            "--state", "OUT.npz", "last state in time, for --restart; written after Ctrl-C too", only="time"
        ),
        Option("--section", "CUT", SECTION, many=True, only="models"),
        Option("--vtu", "binary|compressed|ascii", VTU),
    ),
    "model (adds to what the file says; PART is a part of the mesh or a side x- x+ y- y+ z- z+)": (
        *_all(
            Option(
                "--material", "[PART:][LAW:]E=…,nu=…", "constants in SI units, in place of those of the file"
            ),
            Option("--fix", "PART:xyz[=VALUE]", "prescribed displacement in m along these axes (0)"),
            Option("--symmetry", "PART", "a plane of symmetry: no displacement across it"),
            Option("--tie", "PART:PART", "tie two surfaces, whose meshes need not match"),
            Option("--gravity", "X,Y,Z", "acceleration in m/s²"),
            Option("--traction", "PART:X,Y,Z", "force per area in Pa"),
            Option("--pressure", "PART:P", "pressure in Pa, positive into the body"),
            Option("--point-load", "PART:X,Y,Z", "force in N on a part of one node"),
            Option("--resultant", "PART:X,Y,Z", "force in N in all, spread over the faces of the part"),
            Option("--remote", REMOTE, "force in N and moment in N m at a point in m, spread over a part"),
            Option("--rigid", REMOTE, "the same at a point that a part follows rigidly"),
            Option("--temperature", "T[:REFERENCE]", "of the whole model, and that without strain (0)"),
            many=True,
            only="models",
        ),
        Option("--formulation", "WORD", FORMULATION, only="models"),
        Option("--scale", "FACTOR", "on the coordinates of a mesh file: a number, or mm, cm, in, ft (1)"),
        Option("--units", "SET", UNITS),
        Option("--strict", None, "refuse a file of Kratos of which not all is done that Kratos would do"),
        Option("--linear", None, "small displacements and linear laws, whatever a run file asks for"),
        Option("--ignore-initial-displacement", None, STRESS_FREE),
    ),
    "motion of the material through the mesh (one at most)": _all(
        Option("--rotation", "AXIS:RATE[:ACCELERATION]", "about x, y, z or X,Y,Z, in rad/s and rad/s²"),
        *_all(
            Option("--center", "X,Y,Z", "a point of the axis in m (0,0,0)"),
            Option("--center-velocity", "X,Y,Z", "of the center of the rotation, in m/s"),
            Option("--center-acceleration", "X,Y,Z", "likewise, in m/s²"),
            Option("--stiffening", None, "add the geometric stiffness of the centrifugal stress"),
            needs=("rotation",),
        ),
        Option("--translation", "AXIS:RATE[:ACCELERATION]", "of the moving frame, in m/s and m/s²"),
        Option("--boundaries", "absorbing|periodic|fixed|natural", BOUNDARIES, needs=("translation",)),
        *_all(
            Option("--damping", "ALPHA", "by mass, relative to the motion, in 1/s (0)"),
            Option("--moving-part", "PART", "the part that moves; the others rest (all)"),
            needs=("rotation", "translation"),
        ),
        only="models",
    ),
    "time integration": (
        Option("--time", "STEP:STEPS[:EVERY]", "step in s, their number, and every how many is kept"),
        Option("--steps", "N", "number of steps, overrides the file", only="time"),
        Option("--restart", "STATE.npz", RESTART, only="time"),
        *_all(
            Option("--integrator", "NAME[:NUMBERS]", INTEGRATOR),
            Option("--rayleigh", "ALPHA,BETA", "damping ALPHA·M + BETA·K of models, both ≥ 0, in 1/s and s"),
            Option("--lumped", None, "lumped mass (models)"),
            only="models time",
        ),
    ),
    "solver": (
        Option("--modes", "N", MODES, only="models"),
        Option("--buckling", "N", BUCKLING, only="models"),
        Option("--harmonic", "LOW:HIGH:COUNT[:DAMPING]", HARMONIC, only="models"),
        *_all(
            Option("--solver", "auto|dense|direct|amg", "auto chooses by size"),
            Option("--error", "FRACTION", ERROR),
            Option("--most-unknowns", "N", "of the finest mesh that --error may make", needs=("error",)),
            Option("--tolerance", "NUMBER", "relative residual of the iterative solver (1e-10)"),
            only="models statics",
        ),
        Option("--backend", "own|petsc", BACKEND),
        Option("--petsc", "OPTIONS", "options of PETSc, such as '-pc_type hypre'", needs=("backend",)),
        Option("--threads", "N", "threads of the compiled kernels (all cores)"),
        Option("--progress", None, "show progress, even if not on a terminal"),
        Option("-v --verbose", None, "also list what the solution skipped"),
        Option("-q --quiet", None, "print no summary"),
    ),
}
OF_A_CASE = [option for options in GROUPS.values() for option in options]


def only(word: str) -> list[str]:
    """Return the options that only some cases have: ``models``, ``time`` or ``statics``."""
    return [option.dest for option in OF_A_CASE if word in option.only]


def read_values(options: Namespace) -> None:
    """Put what the texts of options mean in their places; InputError for one that means nothing."""
    for option in OF_A_CASE:
        text = getattr(options, option.dest)
        if option.needs and text and not any(getattr(options, name) for name in option.needs):
            owners = " or ".join(f"--{name}" for name in option.needs)
            cure = "one of them" if len(option.needs) > 1 else "that"
            raise InputError(f"{option.name} belongs to {owners}; give {cure} too")
        if isinstance(text, list):
            setattr(options, option.dest, [option.value_of(word) for word in text])
        elif isinstance(text, str):
            setattr(options, option.dest, option.value_of(text))
