// The page: what the controls mean.

const INK = 0x10141c, GRAY = 0x8a8f98;
const FRAMES_PER_SECOND = 20, SECONDS_PER_CYCLE = 3;

class Page {
  constructor(data) {
    this.data = data;
    prefixed = data.prefixed;
    this.frame = 0;
    [this.phase, this.quarter] = [1, 0];
    this.surface = surfaceOf(data.faces);
    this.positions = new Float32Array(data.points.length);
    const stage = this.stage = new Stage($("view"), data.radius);
    this.body = stage.triangles(true);
    stage.reshape(this.body, this.surface.positions, this.surface.corners);
    this.edges = stage.lines(INK, 0.45, true);
    this.edges.geometry.setAttribute("position", this.body.geometry.attributes.position);
    this.edges.geometry.setIndex(new THREE.BufferAttribute(this.surface.edges, 1));
    this.undeformed = new Float32Array(this.surface.positions.length);
    spread(this.surface, data.points, 3, this.undeformed);
    this.outline = stage.lines(GRAY, 1, true);
    stage.reshape(this.outline, data.points, Uint32Array.from(data.outline));
    this.outlineTrace = stage.lines(GRAY, 1, false);
    this.cap = stage.triangles(false);
    this.capLines = stage.lines(INK, 0.45, false);
    this.trace = stage.lines(INK, 1, false);
    this.mark = stage.mark(0xd2342a, 8);
    this.legend = new Legend();
    this.section = null;
    this.setUp();
    this.choose();
  }

  // ---- controls ----------------------------------------------------------------------------------

  setUp() {
    const { data } = this;
    document.querySelector("h1").textContent = data.title;
    for (const [name, text] of data.about) $("about").append(element("dt", name), element("dd", text));
    data.fields.forEach((field, i) => {
      const group = Object.assign(document.createElement("optgroup"), { label: field.name });
      for (const name of Object.keys(COMPONENTS[field.kind])) {
        const option = element("option", named(field, name));
        option.value = `${i}:${name}`;
        group.append(option);
      }
      $("field").append(group);
    });
    $("field").value = data.shown;
    $("frame").max = data.frames.length - 1;
    for (const control of document.querySelectorAll(".of-frame")) control.hidden = data.frames.length < 2;
    $("frame-kind").textContent = data.kind === "modes" ? "Mode" : "State";
    $("hollow").hidden = data.cells.length > 0;
    $("edges").checked = this.edges.visible = data.edged;
    this.on("field", "change", () => this.choose());
    this.on("refit", "click", () => this.fit());
    for (const id of ["low", "high"]) this.on(id, "change", () => this.setRange());
    this.on("frame", "input", () => this.turnTo(Number($("frame").value)));
    this.on("scale", "input", () => this.update());
    this.on("play", "click", () => this.play());
    for (const button of document.querySelectorAll("[data-step]"))
      button.addEventListener("click", () => this.turnTo(this.frame + Number(button.dataset.step)));
    this.on("axis", "input", () => this.faceSection());
    for (const id of ["flip", "depth"]) this.on(id, "input", () => this.update());
    for (const [id, thing] of [["edges", "edges"], ["outline", "outline"]])
      this.on(id, "change", () => { this[thing].visible = $(id).checked; this.update(); });
    for (const button of document.querySelectorAll("[data-view]"))
      button.addEventListener("click", () => this.stage.look(button.dataset.view.split(",").map(Number)));
    this.on("picture", "click", () => this.save());
    this.on("view", "pointermove", (event) => this.point(event));
    this.on("view", "click", (event) => this.point(event));  // a finger has no other way
    this.on("view", "pointerleave", () => this.unpoint());
    this.on("view", "pointerdown", () => this.unpoint());
    this.stage.onDrawn = () => this.drawTriad();
  }

  on(id, event, action) {
    $(id).addEventListener(event, action);
  }

  // ---- values ------------------------------------------------------------------------------------

  // Return one number for each node, or for each element, of the chosen field in a frame.
  valuesOf(frame) {
    const [index, name] = this.chosen;
    return component(this.data.read(this.data.frames[frame].values[index]), this.data.fields[index].kind, name);
  }

  choose() {
    const [index, name] = $("field").value.split(/:(.*)/s);
    this.chosen = [Number(index), name];
    this.field = this.data.fields[this.chosen[0]];
    this.show(this.frame, false);
    this.fit();
  }

  show(frame, draw = true) {
    this.frame = frame;
    $("frame").value = frame;
    $("frame-name").textContent = this.data.frames[frame].name;
    const { data } = this, { values } = data.frames[frame];
    this.displacement = data.read(values[0]);
    // Of a complex mode there is a part that comes a quarter period later.
    this.later = data.kind === "modes" && values[1] && data.read(values[1]);
    this.values = this.valuesOf(frame);
    if (this.field.at === "element") spreadOfElements(this.surface, this.values, this.surface.values);
    else spread(this.surface, this.values, 1, this.surface.values);
    if (draw) this.update();
  }

  turnTo(frame) {
    const { frames, kind } = this.data;
    if (this.playing && kind === "states") this.play(false);
    this.show((frame + frames.length) % frames.length);
    if (kind === "modes") this.fit();
  }

  fit() {
    let [low, high] = extent(this.values);
    if (this.data.kind === "states")
      for (let frame = 0; frame < this.data.frames.length; frame++) {
        const [least, most] = extent(this.valuesOf(frame));
        [low, high] = [Math.min(low, least), Math.max(high, most)];
      }
    if (high - low <= 1e-6 * Math.max(Math.abs(low), Math.abs(high))) {
      const half = 0.5 * Math.max(Math.abs(low), Math.abs(high)) || 1;
      [low, high] = [low - half, high + half];
    }
    this.range = [low, high];
    this.update();
  }

  setRange() {
    const [low, high] = ["low", "high"].map((id) => this.legend.read($(id).value));
    if (Number.isFinite(low) && Number.isFinite(high) && low < high) this.range = [low, high];
    this.update();
  }

  // ---- drawing -----------------------------------------------------------------------------------

  update() {
    const { data, surface } = this, scale = Number($("scale").value) * data.scale;
    for (let i = 0; i < this.positions.length; i++)
      this.positions[i] = data.points[i] + scale * this.phase * this.displacement[i];
    if (this.later)
      for (let i = 0; i < this.positions.length; i++) this.positions[i] += scale * this.quarter * this.later[i];
    spread(surface, this.positions, 3, surface.positions);
    this.body.geometry.attributes.position.needsUpdate = true;
    colored(this.body, surface.values, this.range);
    const factor = data.kind === "modes" ? Number($("scale").value) : Number(scale.toPrecision(3));
    $("scale-name").textContent = data.kind === "modes" ? `${factor}` : `× ${factor}`;
    this.cut();
    const shown = named(this.field, this.chosen[1]);
    this.legend.show(shown, this.field.unit, this.range);
    document.title = `${this.data.title}: ${shown}`;
    this.unpoint();
    this.stage.draw();
  }

  // Of a new cut keep the half behind the plane, so that its section is in view at once.
  faceSection() {
    const axis = "xyz".indexOf($("axis").value || " ");
    const ahead = () => this.stage.camera.getWorldDirection(new THREE.Vector3()).toArray()[axis];
    if (Math.abs(ahead()) < 0.2) this.stage.look([1, -1, 1]);
    $("flip").checked = ahead() > 0;
    this.update();
  }

  cut() {
    this.section = null;
    const axis = "xyz".indexOf($("axis").value || " "), sign = $("flip").checked ? -1 : 1;
    $("depth").disabled = $("flip").disabled = axis < 0;
    this.normal = [0, 1, 2].map((i) => (i === axis ? sign : 0));
    this.offset = axis < 0 ? 1e30 : sign * (2 * Number($("depth").value) - 1) * this.data.reach[axis];
    this.stage.plane.set(new THREE.Vector3(...this.normal).negate(), this.offset);
    const { positions, corners } = this.surface;
    for (const [lines, X] of [[this.trace, positions], [this.outlineTrace, this.undeformed]])
      this.stage.reshape(lines, axis < 0 ? new Float32Array() : trace(X, corners, this.normal, this.offset));
    this.outlineTrace.visible = this.outline.visible;
    const hasSection = axis >= 0 && this.data.cells.length > 0;
    this.cap.visible = hasSection;
    this.capLines.visible = hasSection && this.edges.visible;
    if (!hasSection) return;
    const ofElements = this.field.at === "element" ? this.values : null;
    const nodal = ofElements ? null : this.values;
    const found = cut(this.data.cells, this.positions, nodal, ofElements, this.normal, this.offset);
    for (const name of ["positions", "values", "lines"]) found[name] = Float32Array.from(found[name]);
    this.section = found;
    this.stage.reshape(this.cap, found.positions);
    colored(this.cap, found.values, this.range);
    this.stage.reshape(this.capLines, found.lines);
  }

  drawTriad() {
    const { camera } = this.stage;
    const ends = [..."xyz"].map((name, i) => {
      const axis = new THREE.Vector3().setComponent(i, 1).transformDirection(camera.matrixWorldInverse);
      return [axis, name, ["#d33", "#2a4", "#36f"][i]];
    }).sort(([one], [other]) => one.z - other.z);
    const drawn = ([{ x, y }, name, color]) =>
      `<line x2="${34 * x}" y2="${-34 * y}" stroke="${color}" stroke-width="3"/>`
      + `<text x="${44 * x}" y="${-44 * y}" fill="${color}">${name}</text>`;
    $("triad").innerHTML = ends.map(drawn).join("");
  }

  // ---- animation ---------------------------------------------------------------------------------

  play(on = !this.playing) {
    this.playing = on;
    $("play").setAttribute("aria-pressed", on);
    $("play").textContent = on ? "■ stop" : "▶ play";
    if (!on) {
      [this.phase, this.quarter] = [1, 0];
      this.update();
      return;
    }
    const start = performance.now(), first = this.frame;
    const turn = (now) => {
      if (!this.playing) return;
      const seconds = (now - start) / 1000, circle = 2 * Math.PI * seconds / SECONDS_PER_CYCLE;
      if (this.data.kind === "states") {
        const frame = (first + Math.floor(seconds * FRAMES_PER_SECOND)) % this.data.frames.length;
        if (frame !== this.frame) this.show(frame);
      } else {
        this.phase = this.data.kind === "modes" ? Math.cos(circle) : (1 - Math.cos(circle)) / 2;
        this.quarter = Math.sin(circle);
        this.update();
      }
      requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
  }

  // ---- values under the pointer ------------------------------------------------------------------

  point(event) {
    if (event.buttons || this.playing) return;
    this.unpoint();
    const found = this.find(...this.stage.ray(event.clientX, event.clientY));
    if (!found) return;
    const box = $("view").getBoundingClientRect(), label = $("pointer");
    label.textContent = this.described(found);
    label.hidden = false;
    const [x, y] = [event.clientX - box.left + 14, event.clientY - box.top + 14];
    label.style.left = `${Math.max(0, Math.min(x, box.width - label.offsetWidth - 4))}px`;
    label.style.top = `${Math.max(0, Math.min(y, box.height - label.offsetHeight - 4))}px`;
    this.stage.reshape(this.mark, this.positions.slice(3 * found.node, 3 * found.node + 3));
    this.mark.visible = true;
    this.stage.draw();
  }

  unpoint() {
    if ($("pointer").hidden) return;
    $("pointer").hidden = true;
    this.mark.visible = false;
    this.stage.draw();
  }

  // What a ray hits first: value there, element, and the nearest of the nodes of the face or cell.
  find(origin, direction) {
    const { normal, offset, surface } = this, slack = 1e-5 * this.data.radius;
    const isCut = ([x, y, z]) => normal[0] * x + normal[1] * y + normal[2] * z > offset + slack;
    const outer = hit(surface.positions, surface.corners, origin, direction, isCut);
    const inner = this.section && hit(this.section.positions, null, origin, direction, () => false);
    const found = inner && (!outer || inner.along < outer.along) ? inner : outer;
    if (!found) return null;
    const values = found === inner ? this.section.values : surface.values;
    found.value = found.shares.reduce((sum, share, i) => sum + share * values[found.at[i]], 0);
    let block, row;
    if (found === inner) {
      [block, row] = this.section.cells[found.triangle];
      found.element = this.section.elements[found.triangle];
    } else {
      [block, row] = faceOf(surface, found.triangle);
      found.element = block.element[row];
    }
    const k = widthOf(block);
    found.node = nearestNode(block.nodes.subarray(row * k, (row + 1) * k), this.positions, found.point);
    return found;
  }

  described({ value, node, element }) {
    const { data, field } = this;
    const place = data.center.map((middle, i) => this.rounded(data.points[3 * node + i] + middle));
    const lines = [written(value, field.unit, 5)];
    lines.push(`node ${data.node_ids[node]} at (${place.join(", ")}) m`);
    if (field.at !== "element") lines[1] += `: ${written(this.values[node], field.unit, 5)}`;
    lines.push(`element ${data.element_ids[element]}`);
    return lines.join("\n");
  }

  // Return a coordinate in the digits that single precision leaves of it.
  rounded(x) {
    const unit = 10 ** Math.floor(Math.log10(this.data.radius) - 5);
    return Number((Math.round(x / unit) * unit).toPrecision(7));
  }

  save() {
    this.legend.over(this.stage.renderer.domElement).toBlob((blob) => {
      const link = document.createElement("a");
      [link.href, link.download] = [URL.createObjectURL(blob), `${this.data.title}.png`];
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }
}

function named(field, component) {
  return component ? `${field.name}, ${component}` : field.name;
}

try {
  globalThis.page = new Page(await unpacked());
} catch (error) {
  $("message").textContent = `This page needs WebGL and a browser of 2023 or later: ${error.message}`;
  $("message").hidden = false;
  throw error;
}
