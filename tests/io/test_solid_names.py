"""The table of solid shapes by their number of nodes."""

from kratos_lite.io.names import SOLIDS
from kratos_lite.shapes import SHAPES


def test_it_has_every_solid_shape_of_the_library():
    solids = {shape for shape in SHAPES.values() if shape.nodes.shape[1] == 3}
    own = {shape for shape in solids if shape.__module__.startswith("kratos_lite.shapes.")}
    assert {nodes: SHAPES[name] for nodes, name in SOLIDS.items()} == {len(s.nodes): s for s in own}
    assert len(SOLIDS) == len(own)
