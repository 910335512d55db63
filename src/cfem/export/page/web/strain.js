// How far the surface is stretched: of each triangle the larger of its two principal stretches less one, whichever way it goes,
// from the lengths and angles of its sides; at a point, the mean of the triangles around it by their areas.
const STRAINED = Array.from({ length: 24 }, (_, k) => { // from grey over yellow and red to black
  const colours = [[0.84, 0.87, 0.91], [0.99, 0.85, 0.40], [0.93, 0.45, 0.18], [0.62, 0.09, 0.22], [0.18, 0.02, 0.16]];
  const place = k / 23 * (colours.length - 1), i = Math.min(Math.floor(place), colours.length - 2);
  return between(colours[i], colours[i + 1], place - i);
});
const KNOWN = 60; // states in which the largest strain is looked for

// rest: places (flat) at rest.
function makeStrain(robot, rest) {
  const { triangles } = robot, count = triangles.length / 3, points = rest.length / 3;
  // Squares and products of the sides of a triangle.
  const sides = (place, k) => {
    const [a, b, c] = [0, 1, 2].map(i => 3 * triangles[3 * k + i]), u = [0, 1, 2].map(d => place[b + d] - place[a + d]), v = [0, 1, 2].map(d => place[c + d] - place[a + d]);
    return [dot(u, u), dot(u, v), dot(v, v)];
  };
  const before = Array.from({ length: count }, (_, k) => sides(rest, k)), areas = before.map(([uu, uv, vv]) => Math.sqrt(Math.max(uu * vv - uv * uv, 0)));
  const around = new Float64Array(points), level = new Float32Array(points);
  areas.forEach((area, k) => { for (let i = 0; i < 3; i++) around[triangles[3 * k + i]] += area; });
  function strains() { // of each point, as the robot is drawn
    level.fill(0);
    for (let k = 0; k < count; k++) {
      if (!areas[k]) continue;
      const [g, h, j] = before[k], [uu, uv, vv] = sides(robot.drawn, k), whole = g * j - h * h;
      const half = (j * uu - 2 * h * uv + g * vv) / (2 * whole), apart = Math.sqrt(Math.max(half * half - (uu * vv - uv * uv) / whole, 0));
      const most = Math.max(Math.abs(Math.sqrt(half + apart) - 1), Math.abs(Math.sqrt(Math.max(half - apart, 0)) - 1));
      for (let i = 0; i < 3; i++) { const p = triangles[3 * k + i]; level[p] += most * areas[k] / around[p]; }
    }
    return level;
  }
  let known = 0;
  // The strain at which the colours end: one point in a hundred has more in the robot's farthest states.
  function scale() {
    if (known) return known;
    const { states, n_a } = robot, all = states.length / n_a, views = [robot.goal, robot.delta_a, robot.lambda_a, robot.x_e], kept = views.map(view => view.slice());
    for (let k = 0; k < Math.min(all, KNOWN); k++) {
      const first = Math.floor(k * all / Math.min(all, KNOWN)) * n_a;
      if (robot.set(states.subarray(first, first + n_a), false, false) & ~STATUS.OUTSIDE) continue;
      robot.shape();
      known = Math.max(known, strains().slice().sort()[Math.floor(0.99 * (points - 1))]);
    }
    views.forEach((view, i) => view.set(kept[i]));
    robot.shape();
    const digit = 10 ** Math.floor(Math.log10(known || 1e-3));
    return known = digit * [1, 1.5, 2, 3, 5, 7, 10].find(value => value * digit >= (known || 1e-3));
  }
  return { strains, scale, levels: most => strains().map(value => value / most) };
}
