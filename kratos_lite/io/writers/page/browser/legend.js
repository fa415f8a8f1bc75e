// The legend: what the colors mean, on the page and in pictures that are saved.

class Legend {
  constructor() {
    $("ramp").style.background = `linear-gradient(to top, ${RAMP.join(", ")})`;
  }

  // Show a quantity, its unit and the lowest and highest value, with one prefix for all numbers.
  show(name, unit, [low, high]) {
    const largest = Math.max(Math.abs(low), Math.abs(high));
    this.power = unit ? prefixOf(largest) : 0;
    // What rounding leaves is 0.
    const shown = (value) => Math.abs(value) < 1e-9 * largest ? "0"
      : `${Number((value / 10 ** this.power).toPrecision(4))}`;
    $("quantity").textContent = name;
    $("unit").textContent = PREFIXES[this.power] + unit;
    $("ticks").replaceChildren(...[0, 0.25, 0.5, 0.75, 1].map((share) => {
      const tick = element("span", shown(low + share * (high - low)));
      tick.style.top = `${100 * (1 - share)}%`;
      return tick;
    }));
    [$("low").value, $("high").value] = [low, high].map(shown);
  }

  // Return a number that somebody typed, in the unit of the legend.
  read(text) {
    return Number(text.replace(",", ".")) * 10 ** this.power;
  }

  // Return a canvas with the body and the legend.
  over(body) {
    const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
    const size = body.height / body.clientHeight, origin = body.getBoundingClientRect();
    [canvas.width, canvas.height] = [body.width, body.height];
    pen.fillStyle = getComputedStyle(document.body).backgroundColor;
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(body, 0, 0);
    pen.scale(size, size);
    pen.fillStyle = getComputedStyle($("view")).color;
    pen.font = getComputedStyle($("legend")).font;
    for (const line of [$("quantity"), $("unit"), ...$("ticks").children]) {
      const box = line.getBoundingClientRect();
      pen.fillText(line.textContent, box.left - origin.left, box.top - origin.top + 15);
    }
    const ramp = $("ramp").getBoundingClientRect(), [x, y] = [ramp.left - origin.left, ramp.top - origin.top];
    const gradient = pen.createLinearGradient(0, y + ramp.height, 0, y);
    RAMP.forEach((color, i) => gradient.addColorStop(i / (RAMP.length - 1), color));
    pen.fillStyle = gradient;
    pen.fillRect(x, y, ramp.width, ramp.height);
    return canvas;
  }
}

function $(id) {
  return document.getElementById(id);
}

function element(name, text) {
  return Object.assign(document.createElement(name), { textContent: text });
}
