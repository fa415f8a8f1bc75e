// Numbers that can be shown: components of vectors and stresses, and how they are written.

// Units of SI take prefixes, those of other sets have theirs.
let prefixed = true;
const PREFIXES = { "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T" };

const COMPONENTS = {
  scalar: { "": (s) => s[0] },
  vector: {
    magnitude: (v) => Math.hypot(v[0], v[1], v[2]), x: (v) => v[0], y: (v) => v[1], z: (v) => v[2],
  },
  tensor: {
    "von Mises": vonMises, Tresca: (s) => principal(s)[0] - principal(s)[2],
    "principal 1": (s) => principal(s)[0], "principal 2": (s) => principal(s)[1],
    "principal 3": (s) => principal(s)[2],
    xx: (s) => s[0], yy: (s) => s[1], zz: (s) => s[2], xy: (s) => s[3], yz: (s) => s[4], zx: (s) => s[5],
  },
};

function vonMises([xx, yy, zz, xy, yz, zx]) {
  const normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2;
  return Math.sqrt(normal / 2 + 3 * (xy * xy + yz * yz + zx * zx));
}

// Eigenvalues, largest first: Smith, Communications of the ACM 4 (1961) 168.
function principal([xx, yy, zz, xy, yz, zx]) {
  const mean = (xx + yy + zz) / 3, [a, b, c] = [xx - mean, yy - mean, zz - mean];
  const half = Math.sqrt((a * a + b * b + c * c) / 6 + (xy * xy + yz * yz + zx * zx) / 3);
  if (half === 0) return [mean, mean, mean];
  const determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * zx) + zx * (xy * yz - b * zx);
  const angle = Math.acos(Math.min(1, Math.max(-1, determinant / (2 * half ** 3)))) / 3;
  const first = mean + 2 * half * Math.cos(angle), third = mean + 2 * half * Math.cos(angle + 2.0943951023931953);
  return [first, 3 * mean - first - third, third];
}

// Return one number for each node or element: a component of values with so many numbers each.
function component(values, kind, name) {
  const width = { scalar: 1, vector: 3, tensor: 6 }[kind], of = COMPONENTS[kind][name];
  const found = new Float32Array(values.length / width);
  for (let i = 0; i < found.length; i++) found[i] = of(values.subarray(i * width, (i + 1) * width));
  return found;
}

function prefixOf(size) {
  const power = prefixed && size > 0 ? 3 * Math.floor(Math.log10(size * (1 + 1e-9)) / 3) : 0;
  return Math.min(12, Math.max(-12, power));
}

// Return a number with its unit, in four digits or as many as asked for.
function written(value, unit, digits = 4) {
  const power = unit ? prefixOf(Math.abs(value)) : 0;
  return `${Number((value / 10 ** power).toPrecision(digits))} ${PREFIXES[power]}${unit}`.trim();
}

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}
