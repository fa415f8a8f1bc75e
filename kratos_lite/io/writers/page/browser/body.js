// The body: its surface as triangles, the section where a plane cuts it, and what lies under a ray.

// Weights of nodes at the points of a lattice, without zeros: for each point pairs (node of the cell, weight).
function sparse(N) {
  return N.map((row) => row.map((weight, node) => [node, weight]).filter(([, weight]) => weight !== 0));
}

function widthOf(block) {
  return block.N[0].length;
}

// Buffers of a surface: points of the lattices of all faces, not shared between faces.
function surfaceOf(faces) {
  const blocks = [];
  let points = 0, triangles = 0;
  for (const block of faces) {
    const count = block.nodes.length / widthOf(block);
    blocks.push({ ...block, weights: sparse(block.N), count, point: points, triangle: triangles });
    points += count * block.N.length;
    triangles += count * block.triangles.length;
  }
  const surface = { blocks, points, triangles };
  surface.corners = indices(blocks, (block) => block.triangles);
  surface.edges = indices(blocks, (block) => block.edges);
  surface.positions = new Float32Array(3 * points);
  surface.values = new Float32Array(points);
  return surface;
}

function indices(blocks, picked) {
  const width = picked(blocks[0])[0].length;
  const found = new Uint32Array(blocks.reduce((sum, b) => sum + b.count * picked(b).length * width, 0));
  let next = 0;
  for (const block of blocks)
    for (let face = 0; face < block.count; face++) {
      const first = block.point + face * block.N.length;
      for (const row of picked(block)) for (const point of row) found[next++] = first + point;
    }
  return found;
}

// Spread nodal values, some numbers each, to the points of a surface.
function spread(surface, nodal, width, into) {
  for (const { nodes, N, weights, count, point } of surface.blocks) {
    const k = N[0].length;
    let next = point * width;
    for (let face = 0; face < count; face++)
      for (const pairs of weights)
        for (let axis = 0; axis < width; axis++) {
          let sum = 0;
          for (const [node, weight] of pairs) sum += weight * nodal[nodes[face * k + node] * width + axis];
          into[next++] = sum;
        }
  }
}

function spreadOfElements(surface, ofElements, into) {
  for (const { element, N, count, point } of surface.blocks)
    for (let face = 0; face < count; face++)
      into.fill(ofElements[element[face]], point + face * N.length, point + (face + 1) * N.length);
}

// Where in the surface a triangle lies: its block and the number of its face there.
function faceOf(surface, triangle) {
  const block = surface.blocks.findLast((one) => triangle >= one.triangle);
  return [block, Math.floor((triangle - block.triangle) / block.triangles.length)];
}

// Cut cells by the plane normal·x = offset: triangles and lines of the section, values and elements on it.
function cut(cells, positions, nodal, ofElements, normal, offset) {
  const section = { positions: [], values: [], lines: [], elements: [], cells: [] };
  const distances = new Float32Array(positions.length / 3);
  for (let i = 0; i < distances.length; i++) distances[i] = dot(normal, positions, 3 * i) - offset;
  for (const block of cells) {
    const k = widthOf(block), weights = sparse(block.N), count = block.nodes.length / k;
    for (let cell = 0; cell < count; cell++) {
      if (!isCut(block.nodes, cell * k, k, distances)) continue;
      const nodes = block.nodes.subarray(cell * k, (cell + 1) * k);
      const lattice = weights.map((pairs) => latticePoint(pairs, nodes, positions, nodal, distances));
      if (ofElements) for (const point of lattice) point[3] = ofElements[block.first + cell];
      for (const tetrahedron of block.tetrahedra) cutTetrahedron(section, lattice, tetrahedron, block, cell);
    }
  }
  return section;
}

function dot([x, y, z], array, at) {
  return x * array[at] + y * array[at + 1] + z * array[at + 2];
}

// Whether there are nodes on both sides of the plane.
function isCut(nodes, first, k, distances) {
  const isInside = distances[nodes[first]] <= 0;
  for (let i = first + 1; i < first + k; i++) if (distances[nodes[i]] <= 0 !== isInside) return true;
  return false;
}

function latticePoint(pairs, nodes, positions, nodal, distances) {
  const point = [0, 0, 0, 0, 0];  // x, y, z, value, distance from the plane
  for (const [node, weight] of pairs) {
    const row = nodes[node];
    for (let axis = 0; axis < 3; axis++) point[axis] += weight * positions[3 * row + axis];
    if (nodal) point[3] += weight * nodal[row];
    point[4] += weight * distances[row];
  }
  return point;
}

// A tetrahedron is four points of the lattice, and for each whether the face opposite is one of the cell.
function cutTetrahedron(section, lattice, [corners, isOuter], block, cell) {
  const inside = [], outside = [];
  for (let i = 0; i < 4; i++) (lattice[corners[i]][4] > 0 ? outside : inside).push(i);
  if (!inside.length || !outside.length) return;
  const [a, b, c] = inside, [d, e, f] = outside;
  let ring = [[a, d], [a, e], [a, f]];
  if (inside.length === 2) ring = [[a, d], [a, e], [b, e], [b, d]];
  if (inside.length === 3) ring = [[a, d], [b, d], [c, d]];
  const points = ring.map(([i, j]) => between(lattice[corners[i]], lattice[corners[j]]));
  for (let i = 1; i + 1 < points.length; i++) {
    for (const point of [points[0], points[i], points[i + 1]]) {
      section.positions.push(point[0], point[1], point[2]);
      section.values.push(point[3]);
    }
    section.elements.push(block.first + cell);
    section.cells.push([block, cell]);
  }
  points.forEach((point, i) => {
    const next = (i + 1) % points.length, used = new Set([...ring[i], ...ring[next]]);
    const opposite = [0, 1, 2, 3].find((corner) => !used.has(corner));
    if (isOuter[opposite]) section.lines.push(...point.slice(0, 3), ...points[next].slice(0, 3));
  });
}

function between(one, other) {
  const share = one[4] / (one[4] - other[4]);
  return one.map((value, i) => value + share * (other[i] - value));
}

// Lines where a plane cuts the triangles of a surface.
function trace(positions, corners, normal, offset) {
  const lines = [], distance = (point) => dot(normal, positions, 3 * point) - offset;
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [corners[t], corners[t + 1], corners[t + 2]], [d, e, f] = [distance(a), distance(b), distance(c)];
    for (const [i, j, from, to] of [[a, b, d, e], [b, c, e, f], [c, a, f, d]])
      if (from <= 0 !== to <= 0) for (let axis = 0; axis < 3; axis++)
        lines.push(positions[3 * i + axis] + from / (from - to) * (positions[3 * j + axis] - positions[3 * i + axis]));
  }
  return Float32Array.from(lines);
}

// First triangle that a ray hits, or null: Möller & Trumbore, Journal of Graphics Tools 2 (1997) 21-28.
function hit(positions, corners, origin, direction, isHidden) {
  const [dx, dy, dz] = direction, [ox, oy, oz] = origin, n = corners ? corners.length : positions.length / 3;
  let nearest = null;
  for (let t = 0; t < n; t += 3) {
    const i = 3 * (corners ? corners[t] : t), j = 3 * (corners ? corners[t + 1] : t + 1);
    const k = 3 * (corners ? corners[t + 2] : t + 2);
    const x = positions[i], y = positions[i + 1], z = positions[i + 2];
    const ax = positions[j] - x, ay = positions[j + 1] - y, az = positions[j + 2] - z;
    const bx = positions[k] - x, by = positions[k + 1] - y, bz = positions[k + 2] - z;
    const px = dy * bz - dz * by, py = dz * bx - dx * bz, pz = dx * by - dy * bx;
    const determinant = ax * px + ay * py + az * pz;
    if (determinant === 0) continue;
    const sx = ox - x, sy = oy - y, sz = oz - z;
    const u = (sx * px + sy * py + sz * pz) / determinant;
    if (u < 0 || u > 1) continue;
    const qx = sy * az - sz * ay, qy = sz * ax - sx * az, qz = sx * ay - sy * ax;
    const v = (dx * qx + dy * qy + dz * qz) / determinant;
    if (v < 0 || u + v > 1) continue;
    const along = (bx * qx + by * qy + bz * qz) / determinant;
    if (along < 0 || (nearest && along >= nearest.along)) continue;
    const point = [ox + along * dx, oy + along * dy, oz + along * dz];
    if (isHidden(point)) continue;
    nearest = { along, point, triangle: t / 3, shares: [1 - u - v, u, v], at: [i / 3, j / 3, k / 3] };
  }
  return nearest;
}

function nearestNode(nodes, positions, [x, y, z]) {
  let best = nodes[0], least = Infinity;
  for (const node of nodes) {
    const [dx, dy, dz] = [positions[3 * node] - x, positions[3 * node + 1] - y, positions[3 * node + 2] - z];
    const away = dx * dx + dy * dy + dz * dz;
    if (away < least) [best, least] = [node, away];
  }
  return best;
}
