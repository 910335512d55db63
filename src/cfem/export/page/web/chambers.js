// The walls of the chambers. The model knows the outer surface and each chamber's volume: the wall goes along with the surface near
// it, and is then blown up evenly to the volume that the model states.
const ROUNDS = 3; // of blowing up: each is a step of Newton's method for the volume

// rest: places (flat) at rest.
function makeChambers(robot, rest) {
  return robot.said.chambers.map(({ actuator, first, count }) => {
    const triangles = robot.triangles.subarray(3 * first, 3 * (first + count)), points = [...new Set(triangles)];
    const corner = (place, k) => { const i = 3 * triangles[k]; return [place[i], place[i + 1], place[i + 2]]; };
    // mm^3 and mm^2; the normals point into the chamber.
    const measured = place => {
      let volume = 0, area = 0;
      const middle = corner(place, 0);
      for (let k = 0; k < triangles.length; k += 3) {
        const [a, b, c] = [0, 1, 2].map(i => add(corner(place, k + i), middle, -1)), n = cross(add(b, a, -1), add(c, a, -1));
        volume -= dot(a, n) / 6;
        area += Math.hypot(...n) / 2;
      }
      return [volume, area];
    };
    const [empty] = measured(rest);
    // To be called whenever the surface has been shaped.
    const inflate = () => {
      for (let round = 0; round < ROUNDS; round++) {
        const [volume, area] = measured(robot.drawn), out = (empty + robot.delta_a[actuator] - volume) / area;
        for (const p of points) for (let d = 3 * p; d < 3 * p + 3; d++) robot.drawn[d] -= out * robot.normals[d];
      }
    };
    return { actuator, inflate, sheet: makeSheet(triangles, robot.drawn, robot.normals, true) };
  });
}
