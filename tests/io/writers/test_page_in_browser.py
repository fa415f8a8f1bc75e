"""Pages in a browser: they open without an error or a request, and their controls change the picture."""

import itertools
import json
import re

import numpy as np
import pytest
from chromium import started, wait

import kratos_lite as kl
from kratos_lite.shapes import SHAPES

STEEL = kl.Isotropic3D(E=2e11, nu=0.3, density=7850.0)

PIXELS = """
const done = arguments[0];
page.stage.draw();
requestAnimationFrame(() => requestAnimationFrame(() => {
  const source = page.stage.renderer.domElement, canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [source.width, source.height];
  const pen = canvas.getContext("2d");
  pen.drawImage(source, 0, 0);
  const pixels = new Uint32Array(pen.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
  let sum = 0;
  for (const pixel of pixels) sum = (31 * sum + pixel) % 4294967291;
  done([new Set(pixels).size, sum]);
}));
"""
SET = """
const [id, value] = arguments, control = document.getElementById(id);
if (control.type === "checkbox") control.checked = value; else control.value = value;
for (const kind of ["input", "change"]) control.dispatchEvent(new Event(kind, { bubbles: true }));
"""


class Browser:
    """A browser with one page open."""

    def __init__(self, driver):
        self.driver = driver

    def open(self, path):
        self.logged()
        self.driver.get(path.as_uri())
        wait(self.driver, "Boolean(globalThis.page) || !message.hidden")
        assert self("return message.textContent") == ""

    def __call__(self, script, *values):
        return self.driver.execute_script(script, *values)

    def actions(self):
        from selenium.webdriver import ActionChains

        return ActionChains(self.driver)

    def pixels(self):
        """Number of colors, and a number that differs from picture to picture."""
        return tuple(self.driver.execute_async_script(PIXELS))

    def set(self, name, value):
        self(SET, name, value)

    def click(self, name):
        self("document.getElementById(arguments[0]).click()", name)

    def array(self, what):
        return np.array(self(f"return Array.from({what})"))

    def logged(self):
        """Messages of the console, and addresses asked for, since the last call."""
        messages = [entry["message"] for entry in self.driver.get_log("browser")]
        # the browser itself reads pixels where it has no screen
        messages = [text for text in messages if "GL Driver Message" not in text]
        events = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        asked = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
        # the first tab asks for parts of the browser
        return messages, [a["request"]["url"] for a in asked if a["documentURL"].startswith("file:")]


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with started(tmp_path_factory.mktemp("profile"), "700,500") as driver:
        yield Browser(driver)


@pytest.fixture(scope="module")
def model():
    model = kl.Model(kl.box((4, 1, 1), (4, 2, 2), element="KinematicLinear3D20N"), STEEL)
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, -1e6)))
    return model


@pytest.fixture(scope="module")
def result(model):
    return model.solve()


@pytest.fixture(scope="module")
def written(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("pages") / "beam.html"
    kl.write(path, result)
    return path


@pytest.fixture
def page(browser, written):
    browser.open(written)
    return browser


def test_a_page_opens_without_a_message_or_a_request(browser, written):
    browser.open(written)
    assert browser.logged() == ([], [written.as_uri()])
    colors, _ = browser.pixels()
    assert colors > 100
    # the picture that is saved has the legend
    top, bottom, body = browser("""
        const canvas = page.legend.over(page.stage.renderer.domElement), pen = canvas.getContext("2d");
        const view = document.getElementById("view").getBoundingClientRect();
        const box = ramp.getBoundingClientRect();
        const pixel = (x, y) => pen.getImageData(x - view.left, y - view.top, 1, 1).data;
        const color = (x, y) => Array.from(pixel(x, y).slice(0, 3));
        return [color(box.left + 8, box.top + 1), color(box.left + 8, box.bottom - 2),
                color(view.left + view.width / 2, view.top + view.height / 2)];
    """)
    assert abs(np.array(top) - (253, 231, 37)).max() < 8
    assert abs(np.array(bottom) - (68, 1, 84)).max() < 8
    assert min(body) < 200


def test_controls_change_the_picture(page):
    seen = {page.pixels()}
    for name, value in (
        *(("field", "0:z"), ("scale", 2), ("low", "-1"), ("edges", False), ("outline", False)),
        *(("axis", "x"), ("depth", 0.3), ("flip", True), ("field", "3:")),
    ):
        page.set(name, value)
        before = len(seen)
        seen.add(page.pixels())
        assert len(seen) > before, f"{name} {value}"
    page("document.querySelector('[data-view=\"1,0,0\"]').click()")
    assert page.pixels() not in seen


def test_dragging_turns_the_body(page):
    before = page.pixels()
    view = page.driver.find_element("id", "view")
    page.actions().move_to_element(view).click_and_hold().move_by_offset(80, 30).release().perform()
    assert page.pixels() != before


def test_every_component_is_that_of_the_result(page, result):
    stress = result.stress("node")
    sigma = np.linalg.eigvalsh(stress[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]])[:, ::-1]
    wanted = {
        "0:magnitude": np.linalg.norm(result.u, axis=1),
        "0:z": result.u[:, 2],
        "2:von Mises": result.von_mises("node"),
        "2:Tresca": sigma[:, 0] - sigma[:, 2],
        **{f"2:principal {i + 1}": sigma[:, i] for i in range(3)},
        **{f"2:{name}": stress[:, i] for i, name in enumerate(("xx", "yy", "zz", "xy", "yz", "zx"))},
        "1:x": result.reaction()[:, 0],
        "3:": result.field("strain_energy_density", "node"),
        "4:": result.error().per_element,
    }
    choices = page("return [...field.options].map((option) => option.value)")
    assert set(wanted) <= set(choices)
    assert len(choices) == 4 + 4 + 11 + 1 + 1
    for choice, values in wanted.items():
        page.set("field", choice)
        assert (
            abs(page.array("page.values") - values).max()
            <= 1e-6 * abs(stress if choice[0] == "1" else values).max()
        )
        low, high = page("return page.range")
        assert abs(low - values.min()) + abs(high - values.max()) <= 2e-6 * abs(values).max() + 1e-6 * abs(
            stress
        ).max() * (choice[0] == "1")


def test_the_legend_has_unit_and_range(page, result):
    page.set("field", "2:xx")
    assert page("return document.title").endswith(": stress, xx")
    assert page("return [quantity.textContent, unit.textContent]") == ["stress, xx", "MPa"]
    ticks = [float(text) for text in page("return [...ticks.children].map((tick) => tick.textContent)")]
    xx = result.stress("node")[:, 0] / 1e6
    wanted = np.linspace(xx.min(), xx.max(), 5)
    assert abs(np.array(ticks) - wanted).max() < 1e-3 * abs(wanted).max()
    page.set("low", "-5")
    page.set("high", "7,5")
    assert page("return page.range") == [-5e6, 7.5e6]
    assert page("return ticks.children[2].textContent") == "1.25"
    page.click("refit")
    assert page("return page.range[1] > 7.6e6")
    page.set("low", "1e-14")  # what rounding leaves
    assert page("return [low.value, ticks.children[0].textContent]") == ["0", "0"]


def test_units_of_other_sets_take_no_prefix(browser, tmp_path):
    model = kl.Model(kl.box((20, 10, 10)), kl.Isotropic3D(E=210e3, nu=0.3), units="mm N MPa t")
    model.fix("x-")
    model.add(kl.Traction("x+", (0, 0, 5e3)))
    kl.write(tmp_path / "part.html", result := model.solve())
    browser.open(tmp_path / "part.html")
    browser.set("field", "2:xx")
    assert browser("return unit.textContent") == "MPa"
    assert abs(float(browser("return high.value")) / result.stress("node")[:, 0].max() - 1) < 1e-3


def test_deformation_moves_the_surface(page, result):
    base = page("return page.data.scale")
    for share in (0, 0.5, 2):
        page.set("scale", share)
        moved = page.array("page.positions").reshape(-1, 3) + page("return page.data.center")
        assert abs(moved - result.mesh.points - share * base * result.u).max() < 1e-5
    assert page("return document.getElementById('scale-name').textContent") == f"× {2 * base:g}"


@pytest.mark.parametrize("element", ["KinematicLinear3D8N", "KinematicLinear3D15N"])
def test_a_cut_shows_the_section_and_its_values(browser, element, tmp_path):
    model = kl.Model(kl.box((3, 2, 1), (3, 2, 2), element=element), kl.Isotropic3D(E=1e6, nu=0.0))
    model.fix("x-")
    model.add(kl.Traction("x+", (1e3, 0, 0)))
    kl.write(tmp_path / "bar.html", model.solve())
    browser.open(tmp_path / "bar.html")
    browser.set("scale", 0)
    browser.set("field", "0:x")
    browser.set("axis", "x")
    for depth, flip in ((0.2, False), (0.7, True)):
        browser.set("depth", depth)
        browser.set("flip", flip)
        x = (depth - 0.5) * 2 * browser("return page.data.reach[0]")
        P = browser.array("page.section.positions").reshape(-1, 3, 3)
        area = np.linalg.norm(np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]), axis=1).sum() / 2
        assert abs(area - 2.0) < 1e-4
        assert abs(P[..., 0] - x).max() < 1e-5
        X = x + browser("return page.data.center[0]")
        assert abs(browser.array("page.section.values") - 1e-3 * X).max() < 1e-7
        lines = browser.array("page.section.lines").reshape(-1, 2, 3)
        length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum()
        # rectangles, each with all its sides; triangles of cells that are no bricks add diagonals
        assert length > 2 * 2 * (2 + 1) - 1e-3
        for outline in ("trace", "outlineTrace"):  # of a section of 2 × 1
            ends = browser.array(f"page.{outline}.geometry.attributes.position.array").reshape(-1, 2, 3)
            assert abs(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() - 6.0) < 1e-4
            assert abs(ends[..., 0] - x).max() < 1e-5


def test_a_new_cut_shows_its_section(page):
    for view, axis in itertools.product(([1, -1, 1], [-1, 1, -1], [1, 0, 0]), "xyz"):
        page("page.stage.look(arguments[0])", view)
        page.set("axis", axis)
        toward = "page.stage.camera.position.clone().normalize().dot(new THREE.Vector3(...page.normal))"
        assert page(f"return {toward}") > 0.2


def meters(text):
    value, unit = text.split()
    return float(value) * {"m": 1, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9}[unit]


def test_the_pointer_tells_node_element_and_value(page, result):
    page.set("field", "0:magnitude")
    page.set("scale", 0)
    for direction in ("1,0,0", "0,0,1"):
        page(f"document.querySelector('[data-view=\"{direction}\"]').click()")
        page.pixels()
        view = page.driver.find_element("id", "view")
        middle = round(page("return (legend.offsetLeft + legend.offsetWidth) / 2"))
        page.actions().move_to_element(view).move_by_offset(middle + 17, 11).perform()
        text = page("return pointer.hidden ? '' : pointer.textContent")
        value, node, place, nodal, element = re.fullmatch(
            r"(\S+ .?m)\nnode (\d+) at \((.*)\) m: (\S+ .?m)\nelement (\d+)", text
        ).groups()
        row, mesh = result.mesh.node_ids.tolist().index(int(node)), result.mesh
        cell = mesh.blocks[0].nodes[mesh.element_ids.tolist().index(int(element))]
        assert row in cell
        assert abs(np.array(place.split(", "), float) - mesh.points[row]).max() < 1e-4
        size = np.linalg.norm(result.u, axis=1)
        assert abs(meters(nodal) - size[row]) < 1e-4 * size.max()
        assert size[cell].min() * 0.99 <= meters(value) <= size[cell].max() * 1.01
    corner = view.size["width"] // 2 - 6, view.size["height"] // 2 - 6
    page.actions().move_to_element_with_offset(view, *corner).perform()
    assert page("return pointer.hidden")


def test_the_pointer_sees_the_section_behind_what_is_cut_away(page):
    page.set("axis", "x")
    page.set("depth", 0.4)
    page("document.querySelector('[data-view=\"1,0,0\"]').click()")
    page.pixels()
    found = page("""
        const middle = (view.clientWidth + legend.offsetLeft + legend.offsetWidth) / 2;
        return page.find(...page.stage.ray(middle, view.clientHeight / 2));
    """)
    assert abs(found["point"][0] - page("return page.offset")) < 1e-4


def test_animation_moves_the_body_and_stops(page):
    page.click("play")
    seen = {page.pixels() for _ in range(5)}
    assert len(seen) > 1
    page.click("play")
    assert page("return page.phase") == 1
    assert page.pixels() == page.pixels()


def test_modes_swing_to_both_sides(browser, model, tmp_path):
    omega, shapes = model.modes(3)
    kl.write_modes(tmp_path / "modes.html", model.mesh, omega, shapes)
    browser.open(tmp_path / "modes.html")
    names = [f"{i}: {w / (2 * np.pi):.5g} Hz" for i, w in enumerate(omega, 1)]
    seen = set()
    for i, name in enumerate(names):
        browser.set("frame", i)
        assert browser("return document.getElementById('frame-name').textContent") == name
        seen.add(browser.pixels())
    assert len(seen) == 3
    step = "document.querySelector('[data-step=\"1\"]').click(); return page.frame"
    assert [browser(step) for _ in names] == [0, 1, 2]
    browser.click("play")
    for sign in (1, -1):
        wait(browser.driver, f"{sign} * page.phase > 0.2")


def test_complex_modes_pass_through_both_parts(browser, tmp_path):
    mesh = kl.box()
    shape = np.random.default_rng(1).normal(size=(1, mesh.n_nodes, 3, 2)) @ [1, 1j]
    kl.write_modes(tmp_path / "modes.html", mesh, [-0.5 + 4j], shape)
    browser.open(tmp_path / "modes.html")
    browser("[page.phase, page.quarter] = [0.6, 0.8]; page.update()")
    scale, wanted = browser("return page.data.scale"), shape[0] / np.linalg.norm(shape[0], axis=1).max()
    moved = (wanted * (0.6 + 0.8j)).real
    places = browser.array("page.positions").reshape(-1, 3) + browser("return page.data.center")
    assert abs(places - mesh.points - scale * moved).max() < 1e-4


def test_states_play_with_one_range_for_all(browser, model, tmp_path):
    transient = model.transient()
    with kl.SeriesWriter(tmp_path / "swing.html", transient) as series:
        states = [transient.state(), *kl.integrate(transient, 2e-4, 6)]
        for state in states:
            series.add(state)
    browser.open(tmp_path / "swing.html")
    largest = max(np.linalg.norm(state.u, axis=1).max() for state in states)
    assert abs(browser("return page.range[1]") - largest) < 1e-4 * largest
    assert browser("return Number(frame.max)") == 6
    first = browser.pixels()
    browser.set("frame", 6)
    assert browser("return document.getElementById('frame-name').textContent") == "t = 0.0012 s"
    assert browser.pixels() != first
    assert abs(browser.array("page.displacement") - states[6].u.ravel()).max() < 1e-4 * largest
    browser.click("play")
    wait(browser.driver, "page.frame != 6")
    back = "const shown = page.frame; document.querySelector('[data-step=\"-1\"]').click(); return shown"
    shown = browser(back)
    assert browser("return [page.playing, page.frame]") == [False, (shown - 1) % 7]


def test_all_kinds_of_cells_together_are_shown_and_cut(browser, tmp_path):
    points, blocks = [], []
    for i, name in enumerate(("Tetrahedron10", "Hexahedron27", "Wedge6", "Pyramid13")):
        X = SHAPES[name].nodes
        rows = np.arange(len(X))[None] + sum(map(len, points))
        points.append(X + 4.0 * i * np.eye(3)[0])
        blocks.append(kl.Block(f"KinematicLinear3D{len(X)}N", rows, ids=[2**60 + i]))
    mesh = kl.Mesh(np.concatenate(points), blocks)
    kl.write_modes(tmp_path / "kinds.html", mesh, [1.0], [1e-9 + 0 * mesh.points])
    browser.open(tmp_path / "kinds.html")
    browser.set("scale", 0)
    browser.set("axis", "z")
    browser.set("depth", 0.6)
    z = browser("return page.offset + page.data.center[2]")
    assert 0.1 < z < 0.9
    P = browser.array("page.section.positions").reshape(-1, 3, 3)
    area = np.linalg.norm(np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]), axis=1).sum() / 2
    # of a simplex, a square, half a square, and what is left of the base of a pyramid
    assert abs(area - ((1 - z) ** 2 / 2 + 4 + 0.5 + 4 * (1 - z) ** 2)) < 1e-4
    for i in range(4):
        element = browser(
            "const [x, y] = arguments, { data } = page;"
            "const found = page.find([x - data.center[0], y - data.center[1], 50], [0, 0, -1]);"
            "return String(data.element_ids[found.element])",
            *(4.0 * i + 0.1, 0.2),
        )
        assert element == str(2**60 + i)


def test_a_narrow_window_keeps_body_and_controls_apart(page):
    size = page.driver.get_window_size()
    page.driver.set_window_size(500, 700)
    try:
        colors, _ = page.pixels()
        assert colors > 100
        view, aside = (
            page(
                "const box = document.querySelector(arguments[0]).getBoundingClientRect();"
                "return [box.top, box.bottom, box.width]",
                name,
            )
            for name in ("main", "aside")
        )
        assert view[1] <= aside[0] + 1
        assert view[2] == aside[2]
        leftmost, right = page("""
            const { camera } = page.stage, X = page.surface.positions, box = view.getBoundingClientRect();
            let least = 1;
            for (let i = 0; i < X.length; i += 3)
              least = Math.min(least, new THREE.Vector3(X[i], X[i + 1], X[i + 2]).project(camera).x);
            return [box.left + (least + 1) / 2 * box.width, legend.getBoundingClientRect().right];
        """)
        assert leftmost > right
    finally:
        page.driver.set_window_size(size["width"], size["height"])


def test_a_dark_browser_has_a_dark_page(page):
    seen = {}
    for style in ("light", "dark"):
        features = [{"name": "prefers-color-scheme", "value": style}]
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        seen[style] = page("""
            const pen = page.legend.over(page.stage.renderer.domElement).getContext("2d");
            const ink = getComputedStyle(legend).color.match(/\\d+/g).map(Number);
            return [Math.max(...pen.getImageData(2, 2, 1, 1).data.slice(0, 3)), Math.max(...ink)];
        """)
    page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert seen["light"][0] == 255
    assert seen["light"][1] < 80
    assert seen["dark"][0] < 60
    assert seen["dark"][1] > 200


def test_without_webgl_a_page_says_so(browser, written, tmp_path):
    text = written.read_text(encoding="utf-8").replace(
        "<head>", "<head><script>HTMLCanvasElement.prototype.getContext = () => null</script>"
    )
    (tmp_path / "blind.html").write_text(text, encoding="utf-8")
    browser.driver.get((tmp_path / "blind.html").as_uri())
    wait(browser.driver, "!message.hidden")
    assert "needs WebGL" in browser("return message.textContent")
