"""Malformed `.mdpa` files end in one clear error or are read, never in anything else."""

import re

import numpy as np
import pytest
from malformed import ACCEPTED, REFUSED

from kratos_lite.errors import InputError
from kratos_lite.io.formats.document import Document
from kratos_lite.io.formats.mdpa.reader import read_mdpa

SAMPLE = b"""Begin ModelPartData
 AMBIENT_TEMPERATURE 2.5e2 // C
End ModelPartData
Begin Table 1 TIME PRESSURE
0 1
End Table
Begin Properties 1
 DENSITY 7620.0
 VOLUME_ACCELERATION [3] (0.0,0.0,-9.81)
 Begin Table TEMPERATURE DENSITY
 1 2
 End Table
End Properties
Begin Nodes
 1 0.0 0.0 0.0
 2 1.0 0.0 0.0
 3 1.0 1.0D0 0.0
 4 0.0 1.0 1.5
End Nodes
Begin Elements KinematicLinear3D4N /* one */
 1 1 1 2 3 4
End Elements
Begin Conditions SurfaceLoadCondition3D3N
 1 1 1 2 3
End Conditions
Begin Geometries Triangle3D3
 1 1 2 3
End Geometries
Begin Constraints LinearMasterSlaveConstraint DISPLACEMENT_X
 1 0.0 [0.5, 0.5] 4 2 3
End Constraints
Begin NodalData DISPLACEMENT_X
 1 1 0.0
End NodalData
Begin NodalData VELOCITY
 1 0 [3] (1,2,3)
End NodalData
Begin ElementalData DENSITY
 1 2.0
End ElementalData
Begin SubModelPart A
 Begin SubModelPartData
  IS_RESTARTED true
 End SubModelPartData
 Begin SubModelPartNodes
 1
 End SubModelPartNodes
 Begin SubModelPart b
 End SubModelPart
End SubModelPart
"""


def outcome(path, data, **options):
    """Read bytes; return the document or the error, and let anything else through."""
    path.write_bytes(data)
    try:
        return read_mdpa(path, **options)
    except InputError as error:
        return error


@pytest.mark.parametrize(("name", "message"), REFUSED.items())
def test_malformed_file_is_refused_with_place_and_reason(malformed, name, message):
    with pytest.raises(InputError) as raised:
        read_mdpa(malformed / f"{name}.mdpa")
    assert re.search(message, str(raised.value))
    assert len(str(raised.value).splitlines()) == 1
    assert str(raised.value).startswith(f"{malformed / name}.mdpa:")


@pytest.mark.parametrize(("name", "notes"), ACCEPTED.items())
def test_odd_file_is_accepted_with_its_notes(malformed, name, notes):
    document = read_mdpa(malformed / f"{name}.mdpa")
    assert [n.text[: len(text)] for n, text in zip(document.notes, notes, strict=True)] == notes
    more = name in ("47_unreferenced_node", "48_coincident_nodes")
    assert (document.mesh.n_nodes, document.mesh.n_elements) == (8 + more, 1)


def test_every_malformed_file_has_its_expectation(malformed):
    names = {path.stem for path in malformed.glob("*.mdpa")}
    assert names == REFUSED.keys() | ACCEPTED.keys()


def test_unknown_element_is_kept_for_the_next_stage(malformed):
    (block,) = read_mdpa(malformed / "04_unknown_element.mdpa").mesh.blocks
    assert (block.name, block.shape, block.nodes.shape) == ("SmallDisplacementElement3D9N", None, (1, 8))


def test_every_prefix_is_read_or_refused(tmp_path):
    """Strictly, and every second one also as Kratos reads."""
    path = tmp_path / "a.mdpa"
    assert list(outcome(path, SAMPLE).mesh.parts) == ["A", "A.b"]
    for n in range(0, len(SAMPLE), 2):
        outcome(path, SAMPLE[:n], strict=False)
    results = [outcome(path, SAMPLE[:n]) for n in range(len(SAMPLE))]
    whole = [n for n, result in enumerate(results) if isinstance(result, Document)]
    ends = [m.end() for m in re.finditer(rb"(?m)^End \w+", SAMPLE)]
    # A prefix is a whole file only where the last block is closed; before its nodes come, it has none.
    first = SAMPLE.index(b"End Nodes")
    assert all(any(end <= n for end in ends) for n in whole)
    assert all((results[n].mesh.n_nodes == 4) == (n > first) for n in whole)
    assert len(whole) < len(SAMPLE) / 10


def test_every_flip_is_read_or_refused(tmp_path):
    rng, refused = np.random.default_rng(0), 0
    for _ in range(1000):
        data = bytearray(SAMPLE)
        data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        result = outcome(tmp_path / "a.mdpa", bytes(data), strict=bool(rng.integers(2)))
        assert isinstance(result, (Document, InputError))
        refused += isinstance(result, InputError)
    assert refused > 200


def test_twenty_problems_are_shown_and_the_rest_counted(tmp_path):
    rows = b"".join(b"%d x 0 0\n" % n for n in range(1, 31))
    error = outcome(tmp_path / "a.mdpa", b"Begin Nodes\n" + rows + b"End Nodes\n")
    lines = str(error).splitlines()
    assert len(lines) == 21
    assert lines[-1] == "… and 10 more"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Begin", r":1:5: a word is missing after 'Begin'; the file ends"),
        ("Begin Elements\nEnd Elements", r":2:1: a word is missing after 'Begin Elements'; found 'End'"),
        ("Begin nodes\nEnd nodes", r":1:1: unknown block 'nodes'; capitals matter: write 'Begin Nodes'"),
        ("Begin SubModelPartNodes\n1\nEnd SubModelPartNodes", r"stands outside the block that it belongs to"),
        ("End Nodes", r":1:1: 'End Nodes' closes nothing"),
        (
            "\nBegin SubModelparts A\nEnd SubModelPart",
            r":2:1: unknown block 'SubModelparts'\. Did you",
        ),
        ("Begin Nodes\n1 0 0 0\nEnd Nodes 5", r":3:11: '5' stands outside any block"),
        ("Begin Nodes\n1 0 0 0\nEnd Nodes /* open", r":3:11: comment '/\*' is never closed"),
        ("Begin Properties x\nEnd Properties", r":1:1: Properties: 'x' is not an id"),
        ("Begin Properties -1\nEnd Properties", r":1:1: Properties: '-1' is not an id"),
        ("Begin SubModelPart A\n 3\nEnd SubModelPart", r":2:2: '3' stands outside any block"),
        ("Begin Elements \xe9\nEnd Elements", r"is no name; use plain letters"),
    ],
)
def test_broken_structure_is_refused_with_its_place(tmp_path, text, message):
    error = outcome(tmp_path / "a.mdpa", text.encode("latin-1"))
    assert isinstance(error, InputError)
    assert re.search(message, str(error))


@pytest.mark.parametrize("name", [".A", "A..b", "A.", "A/b", "../A", "A*"])
def test_part_names_that_are_no_names_are_refused(tmp_path, name):
    text = f"Begin Nodes\n1 0 0 0\nEnd Nodes\nBegin SubModelPart {name}\nEnd SubModelPart\n"
    error = outcome(tmp_path / "a.mdpa", text.encode())
    assert isinstance(error, InputError)
    assert re.search(r":4:1: SubModelPart .* is no name", str(error))


def test_long_line_missing_file_folder_and_broken_gzip(tmp_path):
    path = tmp_path / "a.mdpa"
    assert "a line of more than 1000000 bytes" in str(outcome(path, b"\n//" + b" " * 1_000_000))
    assert ":2: " in str(outcome(path, b"\n//" + b" " * 1_000_000))
    assert "broken gzip" in str(outcome(path, b"\x1f\x8bxx"))
    with pytest.raises(InputError, match="there is no such file"):
        read_mdpa(tmp_path / "none.mdpa")
    with pytest.raises(InputError, match="is a folder"):
        read_mdpa(tmp_path)
