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

PAGE, LIMIT, AGREES = ROOT / "docs" / "about" / "calculix-decks.md", 60, 1e-6
ASKED = "*NODE FILE\nU\n*EL FILE\nS\n"
"""Results that every step writes."""
SOLIDS = ("C3D", "SPRING", "MASS", "DASHPOT", "DCOUP3D", "GAPUNI")
DIFFERS = {
    "beampic": "ccx's iterative solver ends early",
    "segment1": "ccx integrates the centrifugal load by the points of the reduced rule",
    "beamf": "another mass matrix of C3D20R",
}
TEXT = """# Test decks of CalculiX

The decks of CalculiX's own tests that hold solids alone, here and in a live ccx {version}. *Steps*: those in
which displacements of all nodes, or frequencies and buckling factors, were compared. *U*, *S*: largest
difference over the largest value of any node in the worst step; ccx prints seven digits. *Agrees*: U at most
{agrees:g}. {counts}.

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
    row: Row = {}
    try:
        case = kl.read_case(path)
    except kl.KratosLiteError as problem:
        return row | {"verdict": "refused", "reason": str(problem).replace(f"{path}:", "line ")[:160]}
    except Exception as problem:  # XXX
        return row | {"verdict": "crash", "reason": repr(problem)}
    path.write_text(re.sub(r"(?im)^\*END *STEP", f"{ASKED}*END STEP", text))
    try:
        subprocess.run([ccx, "job"], cwd=path.parent, capture_output=True, timeout=LIMIT, check=True)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        return row | {"verdict": "ccx fails"}
    theirs = blocks(path.with_suffix(".frd").read_text("utf-8", "replace"))
    try:
        return row | differences(case, theirs)
    except kl.KratosLiteError as problem:
        return row | {"verdict": "fails", "reason": str(problem)[:160]}
    except Exception as problem:  # XXX
        return row | {"verdict": "crash", "reason": repr(problem)}


def differences(case: kl.Case, theirs: list[tuple[str, float, dict[int, list[float]]]]) -> Row:
    """Return the largest differences of all steps."""
    worst, stress, count, at = 0.0, 0.0, 0, iter(theirs)
    for each in (case, *case.then):
        outcome = kl.run(each)
        if each.modes:
            values, _ = each.model.buckling(each.modes) if each.buckling else each.model.modes(each.modes)
            found = [value for name, value, _ in at_step(at, "DISP", each.modes)]
            ours = values if each.buckling else values / (2 * np.pi)
            worst = max(worst, float(np.abs(ours / found - 1).max()))
            count += 1
            continue
        if each.time is not None:
            return {"verdict": "runs", "steps": count}
        result, mesh = outcome.result, each.model.mesh
        assert result is not None
        for name, ours in (("DISP", result.u), ("STRESS", result.stress("node"))):
            _, _, values = next(block for block in at if block[0] == name)
            used = mesh.used_nodes()
            rows = np.array([values[i] for i in mesh.node_ids[used].tolist()])
            off = np.abs(ours[used] - rows).max() / (np.abs(rows).max() or 1.0)
            worst, stress = (max(worst, off), stress) if name == "DISP" else (worst, max(stress, off))
        count += 1
    return {
        "verdict": "agrees" if worst <= AGREES else "differs", "steps": count,
        "U": error(worst), "S": error(stress) if stress else "",
    }  # fmt: skip


def at_step(at, name: str, count: int):
    """Yield the next blocks of a name."""
    for _ in range(count):
        yield next(block for block in at if block[0] == name)


def blocks(frd: str) -> list[tuple[str, float, dict[int, list[float]]]]:
    """Return the blocks of results in an `.frd` file: name, value of the step, values by node."""
    found, value = [], 0.0
    starts = [m.start() for m in re.finditer(r"(?m)^  100C|^ -4 ", frd)] + [len(frd)]
    for a, b in pairwise(starts):
        if frd.startswith("  100C", a):
            value = float(frd[a + 12 : a + 24])
            continue
        rows, text = {}, frd[a:b]
        for line in re.findall(r"(?m)^ -1(.*)$", text):
            rows[int(line[:10])] = [float(line[i : i + 12]) for i in range(10, len(line) - 11, 12)]
        found.append((text[5:13].strip(), value, rows))
    return found


def page(rows: list[Row], version: str) -> str:
    """Return the page of all rows."""
    names = ("deck", "steps", "verdict", "U", "S", "reason")
    counts = ", ".join(f"{n} {verdict}" for verdict, n in Counter(row["verdict"] for row in rows).items())
    body = [
        [
            str(row.get(name, DIFFERS.get(str(row["deck"]), "")) if name == "reason" else row.get(name, ""))
            for name in names
        ]
        for row in rows
    ]
    return TEXT.format(version=version, agrees=AGREES, counts=counts) + table(names, body)
