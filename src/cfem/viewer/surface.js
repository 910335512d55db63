// Surfaces to draw: sheets of given points, and tubes and balls made here.
const SIDES = 12, LATITUDES = [-0.995, -0.9, -0.68, -0.36, 0, 0.36, 0.68, 0.9, 0.995];

// place, normal: x, y, z of each point (mm), which may change from picture to picture; level: 0 to 1 of each point on a scale of
// colours, or null; flipped: whether the normals point into what is drawn.
function makeSheet(triangles, place, normal, flipped = false) {
  return { triangles, place, normal, flipped, level: null, at: new Float32Array(place.length), tones: new Float32Array(place.length) };
}

// Normals of the points of triangles (3 numbers each), by the areas around them; into `normal`.
function normalsOf(place, triangles, normal) {
  normal.fill(0);
  for (let k = 0; k < triangles.length; k += 3) {
    const [a, b, c] = [3 * triangles[k], 3 * triangles[k + 1], 3 * triangles[k + 2]];
    const ux = place[b] - place[a], uy = place[b + 1] - place[a + 1], uz = place[b + 2] - place[a + 2];
    const vx = place[c] - place[a], vy = place[c + 1] - place[a + 1], vz = place[c + 2] - place[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const i of [a, b, c]) { normal[i] += x; normal[i + 1] += y; normal[i + 2] += z; }
  }
  for (let i = 0; i < normal.length; i += 3) {
    const size = Math.hypot(normal[i], normal[i + 1], normal[i + 2]) || 1;
    normal[i] /= size; normal[i + 1] /= size; normal[i + 2] /= size;
  }
  return normal;
}

// A tube along points with flat ends, or a ball about a lone one.
function tubeSheet(points, radius) {
  const place = [], normal = [], triangles = [], lone = points.length === 1;
  const centres = lone ? LATITUDES.map(height => add(points[0], [0, 0, radius * height])) : points;
  let side = null, way = [0, 0, 1];
  const ring = (centre, radius, way, share, rise) => {
    const across = cross(way, side);
    for (let k = 0; k < SIDES; k++) {
      const angle = 2 * Math.PI * k / SIDES, n = add(side.map(value => value * Math.cos(angle)), across, Math.sin(angle));
      place.push(...add(centre, n, radius));
      normal.push(...add(n.map(value => value * share), way, rise));
    }
  };
  const joined = (i, j) => { for (let k = 0; k < SIDES; k++) { const next = (k + 1) % SIDES; triangles.push(i + k, i + next, j + k, j + k, i + next, j + next); } };
  centres.forEach((centre, i) => {
    const step = add(centres[Math.min(i + 1, centres.length - 1)], centres[Math.max(i - 1, 0)], -1);
    if (Math.hypot(...step) > 0) way = unit(step); // where a line turns back, the way that it came
    const kept = side ? cross(way, cross(side, way)) : [0, 0, 0];
    side = unit(Math.hypot(...kept) > 1e-6 ? kept : cross(way, Math.abs(way[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    const share = lone ? Math.sqrt(1 - LATITUDES[i] ** 2) : 1, end = i === 0 ? -1 : i === centres.length - 1 ? 1 : 0;
    const disc = rise => { ring(centre, 0, way, 0, rise); ring(centre, radius, way, 0, rise); };
    if (end < 0 && !lone) { disc(-1); joined(0, SIDES); }
    ring(centre, radius * share, way, share, lone ? LATITUDES[i] : 0);
    const count = place.length / 3;
    if (i) joined(count - 2 * SIDES, count - SIDES);
    if (end > 0 && !lone) { disc(1); const all = place.length / 3; joined(all - SIDES, all - 2 * SIDES); }
  });
  return makeSheet(Uint32Array.from(triangles), Float32Array.from(place), Float32Array.from(normal));
}
