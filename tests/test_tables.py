"""Tables that notebooks show: the rows that are printed, as HTML."""

from html.parser import HTMLParser

import numpy as np

import kratos_lite as kl


class Cells(HTMLParser):
    """Collects the text of the cells of a table and checks that tags are closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.cells, self.caption = [], [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        if tag == "td":
            self.cells.append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] == ["td"]:
            self.cells[-1] += data
        if self.open[-1:] == ["caption"]:
            self.caption += data


def shown(thing):
    """Return the caption and the rows of the table of a thing."""
    found = Cells(thing._repr_html_())
    assert not found.open
    return found.caption, list(zip(found.cells[::2], found.cells[1::2], strict=True))


def loaded_bar():
    model = kl.Model(kl.box((1, 1, 1), (2, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.3))
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 5.0)))
    return model


def test_notebooks_show_the_rows_that_are_printed():
    model = loaded_bar()
    result = model.solve()
    element = kl.KinematicLinear3D8N(kl.KinematicLinear3D8N.nodes)
    for name, thing in {
        "Mesh": model.mesh,
        "Model": model,
        "Result": result,
        "Report": result.report,
        "KinematicLinear3D8N": element,
    }.items():
        assert shown(thing) == (name, thing.table())
        lines = str(thing).splitlines()
        assert [line.split()[0] for line in lines] == [label.split()[0] for label, _ in thing.table()]
        assert all(line.endswith(value) for line, (_, value) in zip(lines, thing.table(), strict=True))


def test_names_with_signs_of_html_are_shown_as_they_are():
    mesh = kl.box()
    mesh.add_part("<b>&top", lambda X: X[:, 2] > 0.5)
    assert ("part", "<b>&top: 4 nodes") in shown(mesh)[1]
    assert "<b>" not in mesh._repr_html_()


def test_mesh_is_short_in_a_list_and_says_its_contents_in_print():
    mesh = kl.box((2, 1, 1), (2, 1, 1))
    assert repr([mesh]) == "[Mesh(12 nodes, 2 elements)]"
    assert str(mesh).splitlines()[:2] == ["nodes     12", "extent    [0, 2] × [0, 1] × [0, 1] m"]


def test_tables_of_elements_count_them():
    X = np.array([kl.KinematicLinear3D8N.nodes] * 2)
    rows = dict(kl.KinematicLinear3D8N(X).table())
    assert (rows["elements"], rows["volume"]) == ("2", "16 m³")
