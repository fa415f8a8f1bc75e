"""CalculiX's test decks of solids alone, here and in a live ccx, and a page with a row each."""

from __future__ import annotations

import gzip
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from itertools import pairwise
from pathlib import Path
from time import perf_counter

import numpy as np

import kratos_lite as kl
from benchmarks.accuracy import bracket
from benchmarks.driver import ROOT, load, save
from benchmarks.tables import Row, error, table
from kratos_lite.io.abaqus.deck import Deck
from kratos_lite.io.abaqus.job import Job
from kratos_lite.io.abaqus.mesh import ELEMENT_TYPES

PAGE, LIMIT, AGREES = ROOT / "docs" / "about" / "calculix-decks.md", 60, 1e-6
RESULTS = Path(__file__).with_name("results") / "decks.json"
ASKED = "*NODE FILE\nU\n*EL FILE\nS\n*NODE PRINT, NSET=EVERY, GLOBAL=YES\nU\n"
"""Results that every step writes."""
SOLIDS = ("C3D", "SPRING", "MASS", "DASHPOT", "DCOUP3D", "GAPUNI")
MODAL = "ccx keeps the modes that it found alone; here the whole model answers"
RULE = "ccx takes mass and body forces of C3D20R by 2×2×2 points, here they are exact"
DIFFERS = {
    **dict.fromkeys([f"beamdy{i}" for i in (*range(1, 8), 14, 15, 19)], MODAL),
    **dict.fromkeys(["beamdy8", "beamdy9"], f"{MODAL}; {RULE}"),
    **dict.fromkeys(["beamf", "beamft", "beamptied7", "disk2", "segment1", "segment2"], RULE),
    **dict.fromkeys(["beamnldyp", "beamnlmpc", "beamnlp"], "ccx ends its iterations early"),
    "beamnh": "ccx ends its iterations early; 7e-7 in units in which its smallest residual of 1e-6 is less",
    "beampiso": "ccx ends its iterations early; 4e-7 with CONTROLS of 1e-8",
    **dict.fromkeys(["beamnlt", "beampt"], "ccx subtracts heat from the gradient of displacements"),
    **dict.fromkeys(
        ["beamimpdy1", "beamimpdy1nodirect", "beamimpdy2"], "other increments, and damping in HHT"
    ),
    **dict.fromkeys(["beamdynamic", "beamnldy", "beamnldynodirect"], "a sudden load in one increment"),
    "spring5": MODAL,
    "beampic": "the iterative solver of ccx ends early",
    "cubef2f3": "faces are tied in the mean here, node by node in ccx",
    "dloadlinIf": "9 modes of C3D8I twist stiffly: mode 4 is 249 Hz in ccx, 182.0 here, 181.9 with C3D20",
    "damper1": "damping by mass of rigid motions in HHT",
}
SIZES = (("C3D10", 8), ("C3D10", 13), ("C3D20R", 8), ("C3D8", 20), ("bracket", 4), ("C3D10", 18))
"""Elements and cells along the short edges of a block 1 × 1 × 2 under its weight; 12 mm / n in a bracket."""
TIMES = """Blocks 1 × 1 × 2 under their weight and a bracket of C3D10 by Gmsh (`python -m benchmarks decks`),
and a bar with a hole that FreeCAD meshed (`python -m benchmarks decks bar.inp`), whole processes: seconds of
processors, and memory."""
TEXT = """# Test decks of CalculiX

The decks of CalculiX's own tests that hold solids alone, here and in a live ccx {version}. *Tables*: those of
displacements of all nodes, frequencies, buckling factors and stresses that both print at the same times.
*U*: largest difference of displacements, frequencies and factors over the largest value of its table, of
seven printed digits (in time, some tables are nearly 0); *S*: of stresses at nodes, of six. *Agrees*: U at
most {agrees:g}. {counts}.

"""


def decks(folder: Path, ccx: str = "ccx") -> None:
    """Run the decks in a folder and write the page."""
    version = subprocess.run([ccx, "-v"], capture_output=True, text=True, check=False).stdout.split()[-1]
    rows = []
    for file in sorted([*folder.glob("*.inp"), *folder.glob("*.inp.gz")]):
        data = gzip.decompress(file.read_bytes()) if file.suffix == ".gz" else file.read_bytes()
        text = data.decode("utf-8", "replace").replace("\r\n", "\n")
        kinds = {kind.upper() for kind in re.findall(r"(?im)^\*ELEMENT\b.*?TYPE\s*=\s*([A-Z0-9]+)", text)}
        if not any(k.startswith("C3D") for k in kinds) or not all(k.startswith(SOLIDS) for k in kinds):
            continue
        with tempfile.TemporaryDirectory() as scratch:
            for other in folder.iterdir():  # files that decks include
                if re.search(rf"(?i)INPUT\s*=\s*{re.escape(other.name.removesuffix('.gz'))}\b", text):
                    content = other.read_bytes()
                    content = gzip.decompress(content) if other.suffix == ".gz" else content
                    Path(scratch, other.name.removesuffix(".gz")).write_bytes(content)
            name = file.name.removesuffix(".gz").removesuffix(".inp")
            rows.append({"deck": name} | compared(text, Path(scratch, "job.inp"), ccx))
        print(rows[-1], flush=True)
    PAGE.write_text(page(rows, version), encoding="utf-8")


def compared(text: str, path: Path, ccx: str) -> Row:
    """Return the row of a deck."""
    path.write_text(text)
    try:
        ids = Deck(path).mesh.node_ids.tolist()
        head = "".join(f"{i},\n" for i in ids)
        text = re.sub(r"(?im)^\*STEP", f"*NSET, NSET=EVERY\n{head}*STEP", text, count=1)
        path.write_text(re.sub(r"(?im)^\*END *STEP", f"{ASKED}*END STEP", text))
        Job(path, lambda line: None).run()
    except kl.KratosLiteError as problem:
        return {"verdict": "refused", "reason": str(problem).replace(f"{path}:", "")[:150]}
    ours = printed(path)
    path.with_suffix(".dat").unlink()
    path.with_suffix(".frd").unlink()
    try:
        subprocess.run([ccx, "job"], cwd=path.parent, capture_output=True, timeout=LIMIT, check=True)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        return {"verdict": "ccx fails"}
    theirs = printed(path)
    common = [key for key in theirs if key in ours and len(theirs[key]) == len(ours[key])]
    row: Row = {"tables": f"{len(common)} of {len(theirs)}"}
    worst = {what: [off(ours[key], theirs[key]) for key in common if key[0] == what] for what in "US"}
    row |= {what: error(max(found)) for what, found in worst.items() if found}
    agrees = bool(worst["U"]) and max(worst["U"]) <= AGREES
    return row | {"verdict": "agrees" if agrees else "differs"}


def speed(deck: Path, ccx: str = "ccx") -> None:
    """Measure a deck, or blocks without one, whole processes one after the other, and keep the rows."""
    rows = load(RESULTS).get("rows", [])
    for kind, n in ((deck.stem, 0),) if deck.is_file() else SIZES:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "job.inp")
            unknowns = write_block(path, kind, n) if n else copied(deck, path)
            ours, u = timed([sys.executable, "-m", "kratos_lite", "ccx", "job"], folder), printed(path)
            theirs, v = timed([ccx, "job"], folder), printed(path)
            worst = max(off(u[key], v[key]) for key in v if key[0] == "U")
        rows = [row for row in rows if (row["element"], row["unknowns"]) != (kind, unknowns)]
        rows.append({"element": kind, "unknowns": unknowns, "U": worst, "kratos_lite": ours, "ccx": theirs})
        print(rows[-1], flush=True)
        save(RESULTS, {"set": "decks", "rows": rows})


def copied(deck: Path, path: Path) -> int:
    """Copy a deck; return its unknowns."""
    path.write_bytes(deck.read_bytes())
    model = kl.read_case(path).model
    return int((~model.supports.fixed[model.mesh.used_nodes()]).sum())


def timed(words: list[str], folder: str) -> tuple[float, float, float]:
    """Return seconds, seconds of processors, and megabytes of a process."""
    start = perf_counter()
    child = subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL)
    _, code, used = os.wait4(child.pid, 0)
    if code:
        raise RuntimeError(f"{words[0]} ends with {code}")
    times = perf_counter() - start, used.ru_utime + used.ru_stime
    return round(times[0], 2), round(times[1], 2), round(used.ru_maxrss / 1024)


def write_block(path: Path, kind: str, n: int) -> int:
    """Write the deck of a block, or of the bracket in mm; return its unknowns."""
    if kind == "bracket":
        model = bracket(kind, n)
        kind, mesh, points = "C3D10", model.mesh, 1e3 * model.mesh.points
        forces = model.loads[0].forces(mesh, model.element_groups())
        base, some = np.flatnonzero(model.supports.fixed[:, 0]) + 1, np.argwhere(forces).tolist()
        load = "\n".join(["*CLOAD", *(f"{i + 1}, {j + 1}, {forces[i, j]:.15g}" for i, j in some)])
    else:
        mesh = kl.box((1.0, 1.0, 2.0), (n, n, 2 * n), ELEMENT_TYPES[kind])
        points, load = mesh.points, "*DLOAD\nALL, GRAV, 9810., 0., .6, -.8"
        base = np.flatnonzero(points[:, 2] == 0) + 1
    cells = mesh.blocks[0].nodes[:, list(mesh.blocks[0].known_shape.to_vtk)] + 1
    enumerated = [(i, *x) for i, x in enumerate(points.tolist(), 1)]
    rows = [",\n".join(", ".join(map(str, row[i : i + 10])) for i in range(0, len(row), 10))
            for row in np.column_stack([np.arange(1, len(cells) + 1), cells]).tolist()]  # fmt: skip
    path.write_text(
        "*NODE, NSET=EVERY\n"
        + "".join("{}, {:.15g}, {:.15g}, {:.15g}\n".format(*row) for row in enumerated)
        + f"*ELEMENT, TYPE={kind}, ELSET=ALL\n" + "\n".join(rows)
        + "\n*NSET, NSET=BASE\n" + ",\n".join(map(str, base.tolist()))
        + "\n*MATERIAL, NAME=STEEL\n*ELASTIC\n210000., .3\n*DENSITY\n7.85e-9\n"
        "*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL\n*BOUNDARY\nBASE, 1, 3\n*STEP\n*STATIC\n"
        f"{load}\n{ASKED}*END STEP\n"
    )  # fmt: skip
    return 3 * (mesh.n_nodes - len(base))


def off(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Return the largest difference over the largest value."""
    return float(np.abs(ours - theirs).max() / (np.abs(theirs).max() or 1.0))


def printed(path: Path) -> dict[tuple[str, int, float], np.ndarray]:
    """Return displacements, frequencies and factors of `.dat` (U), and stresses of `.frd` (S), by time.

    Modes themselves are left out, as they have either sign, and equal frequencies any shapes.
    """
    found: dict[tuple[str, int, float], np.ndarray] = {}
    modal, of_modes = False, None
    parts = re.split(r"(?m)^ (?=\D*for set)|^ *(?=[EB] [IU] [GC])", path.with_suffix(".dat").read_text())
    for part in parts:
        kind, _, rows = part.partition("\n")
        values = [line.split() for line in rows.splitlines() if re.fullmatch(r"[\s\dEe.+-]+", line)]
        if "N U M B E R" in kind:
            modal, of_modes = True, None
        elif "displacements" in kind and "EVERY" in kind:
            of_modes = kind.split()[-1] if modal and of_modes is None else of_modes
            modal = modal and kind.split()[-1] == of_modes
            if modal:
                continue
            values = sorted((v for v in values if len(v) == 4), key=lambda v: int(v[0]))
            found["U", 0, float(kind.split()[-1])] = np.array(values, dtype=float)[:, 1:]
        elif kind.startswith(("E I", "B U")):
            columns = 1 if kind.startswith("B") else 3
            values = [v[columns] for v in values if len(v) > columns and v[0].isdigit()]
            found["U", sum(key[1] > 0 for key in found) + 1, 0.0] = np.array(values, dtype=float)
    frd = path.with_suffix(".frd").read_text("utf-8", "replace")
    starts = [m.start() for m in re.finditer(r"(?m)^  100C|^ -4 ", frd)] + [len(frd)]
    time = 0.0
    for a, b in pairwise(starts):
        if frd.startswith("  100C", a):
            time, modal = float(frd[a + 12 : a + 24]), frd[a + 57] in "24"
        elif modal:
            continue
        elif frd[a + 5 : a + 13].strip() in ("STRESS", "DISP", "DISPI"):
            name = "S" if frd[a + 5] == "S" else "U"
            lines = re.findall(r"(?m)^ -1(.*)$", frd[a:b])
            rows = [[float(line[i : i + 12]) for i in range(10, len(line) - 11, 12)] for line in lines]
            key = name, -1 - ("DISPI" in frd[a : a + 13]), time
            if name == "S" or "DISPI" in frd[a : a + 13] or ("U", 0, time) not in found:
                found[key] = np.array(rows)
    return found


def page(rows: list[Row], version: str) -> str:
    """Return the page of all rows, and of the times that are kept."""
    counts = ", ".join(f"{n} {verdict}" for verdict, n in Counter(row["verdict"] for row in rows).items())
    names = ("deck", "tables", "verdict", "U", "S", "reason")
    why = [row | {"reason": row.get("reason", DIFFERS.get(str(row["deck"]), ""))} for row in rows]
    body = [[str(row.get(name, "")) for name in names] for row in why]
    head = TEXT.format(version=version, agrees=AGREES, counts=counts)
    return head + table(names, body) + times(load(RESULTS).get("rows", []))


def times(rows: list[Row]) -> str:
    """Return the table of times."""
    names = ("deck", "unknowns", "kratos_lite", "ccx", "ratio", "difference of U")
    body = [
        [row["element"], str(row["unknowns"]), *("{1} s, {2} MB".format(*row[n]) for n in names[2:4]),
         f"{row['ccx'][1] / row['kratos_lite'][1]:.1f}", error(row["U"])]
        for row in rows
    ]  # fmt: skip
    return f"\n## Time\n\n{TIMES}\n\n{table(names, body)}"
