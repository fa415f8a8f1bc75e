"""CalculiX's test decks of solids alone, here and in a live ccx, and a page with a row each."""

from __future__ import annotations

import gzip
import re
import subprocess
import tempfile
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np

import kratos_lite as kl
from benchmarks.driver import ROOT
from benchmarks.tables import Row, error, table
from kratos_lite.io.abaqus.deck import Deck
from kratos_lite.io.abaqus.job import Job

PAGE, LIMIT, AGREES = ROOT / "docs" / "about" / "calculix-decks.md", 60, 1e-6
ASKED = "*NODE FILE\nU\n*EL FILE\nS\n*NODE PRINT, NSET=EVERY, GLOBAL=YES\nU\n"
"""Results that every step writes."""
SOLIDS = ("C3D", "SPRING", "MASS", "DASHPOT", "DCOUP3D", "GAPUNI")
DIFFERS = {
    "beampic": "ccx's iterative solver ends early",
    "segment1": "ccx integrates the centrifugal load by the points of the reduced rule",
    "beamf": "another mass matrix of C3D20R",
}
TEXT = """# Test decks of CalculiX

The decks of CalculiX's own tests that hold solids alone, here and in a live ccx {version}. *Tables*: those of
displacements of all nodes, frequencies, buckling factors and stresses that both print at the same times.
*U*: largest difference of displacements, frequencies and factors over the largest value, of seven printed
digits; *S*: of stresses at nodes, of six. *Agrees*: U at most {agrees:g}. {counts}.

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


def off(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Return the largest difference over the largest value."""
    return float(np.abs(ours - theirs).max() / (np.abs(theirs).max() or 1.0))


def printed(path: Path) -> dict[tuple[str, int, float], np.ndarray]:
    """Return displacements, frequencies and factors of `.dat` (U), and stresses of `.frd` (S), by time."""
    found: dict[tuple[str, int, float], np.ndarray] = {}
    parts = re.split(r"(?m)^ (?=\D*for set)|^ *(?=[EB] [IU] [GC])", path.with_suffix(".dat").read_text())
    for part in parts:
        kind, _, rows = part.partition("\n")
        values = [line.split() for line in rows.splitlines() if re.fullmatch(r"[\s\dEe.+-]+", line)]
        if "displacements" in kind and "EVERY" in kind:
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
            time = float(frd[a + 12 : a + 24])
        elif frd[a + 5 : a + 13].strip() in ("STRESS", "DISP", "DISPI"):
            name = "S" if frd[a + 5] == "S" else "U"
            lines = re.findall(r"(?m)^ -1(.*)$", frd[a:b])
            rows = [[float(line[i : i + 12]) for i in range(10, len(line) - 11, 12)] for line in lines]
            key = name, -1 - ("DISPI" in frd[a : a + 13]), time
            if name == "S" or "DISPI" in frd[a : a + 13]:
                found[key] = np.array(rows)
    return found


def page(rows: list[Row], version: str) -> str:
    """Return the page of all rows."""
    names = ("deck", "tables", "verdict", "U", "S", "reason")
    counts = ", ".join(f"{n} {verdict}" for verdict, n in Counter(row["verdict"] for row in rows).items())
    body = [
        [
            str(row.get(name, DIFFERS.get(str(row["deck"]), "")) if name == "reason" else row.get(name, ""))
            for name in names
        ]
        for row in rows
    ]
    return TEXT.format(version=version, agrees=AGREES, counts=counts) + table(names, body)
