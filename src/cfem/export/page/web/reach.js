// Where the first watched point can be, by the model: a line or a net over the forces of one or two actuators, else a cloud
// between the states that the model was trained on, which grows while there is time (more). And where the body is on the way:
// the outermost points of some of its shapes.
const LINES = 13, STEPS = 40, CLOUD = 8000;
const SHAPES = 24; // of the body, between the states that the model was trained on
const APART = 0.045; // of the robot's length: one point of the cloud in each cube of that edge

function makeReach(robot) {
  const { said, n_a } = robot, reach = { places: [], outermost: [], lines: n_a <= 2, done: false };
  const held = status => !(status & ~STATUS.OUTSIDE) && said.actuators.every(({ delta, lambda, scale }, i) => {
    const room = 1e-3 * (delta[1] - delta[0]), slack = 0.02 * scale;
    return robot.delta_a[i] >= delta[0] - room && robot.delta_a[i] <= delta[1] + room
      && (lambda[0] === null || robot.lambda_a[i] >= lambda[0] - slack) && (lambda[1] === null || robot.lambda_a[i] <= lambda[1] + slack);
  });
  const place = () => robot.x_e.slice(...said.points[0].rows);
  const ends = said.actuators.map(({ lambda, scale }) => [lambda[0] ?? -scale, Math.min(lambda[1] ?? Infinity, 1.2 * scale)]);

  const keep = () => { robot.shape(); reach.outermost.push(...outermost(robot.drawn)); };

  function* net() {
    for (let axis = 0; axis < n_a; axis++) for (let i = 0; i < (n_a === 1 ? 1 : LINES); i++) {
      robot.home();
      let last = null;
      for (let k = 0; k <= STEPS; k++) {
        const shares = n_a === 1 ? [k / STEPS] : axis ? [i / (LINES - 1), k / STEPS] : [k / STEPS, i / (LINES - 1)];
        const here = held(robot.set(shares.map((share, j) => ends[j][0] + share * (ends[j][1] - ends[j][0])), true, true)) ? place() : null;
        if (here && last) reach.places.push(...last, ...here);
        if (here && i % 4 === 0 && k % 4 === 0) keep();
        last = here;
        yield;
      }
    }
  }

  // Of the i-th pair of states, a point between them, the ends more often; each third pair has the first state, the robot at rest.
  // Points that are close together are shown once.
  function* cloud() {
    const { states } = robot, count = states.length / n_a, seen = new Set(), edge = APART * said.length;
    for (let i = 0; i < CLOUD && count; i++) {
      const a = i % count, b = i % 3 ? (i * 7919 + Math.floor(i / count) * 104729 + 1) % count : 0, share = i < count ? 0 : (i * 0.6180339887) % 1 * (b ? 0.5 : 1);
      if (held(robot.set(Array.from({ length: n_a }, (_, j) => states[a * n_a + j] * (1 - share) + states[b * n_a + j] * share), false, false))) {
        const here = place(), cube = here.map(value => Math.round(value / edge)).join();
        if (!seen.has(cube)) { seen.add(cube); reach.places.push(...here); }
      }
      yield;
    }
  }

  const work = reach.lines ? net() : cloud();
  if (!reach.lines) {
    const count = robot.states.length / n_a, each = Math.ceil(count / SHAPES);
    for (let a = 0; a < count; a += each) if (held(robot.set(Array.from({ length: n_a }, (_, j) => robot.states[a * n_a + j]), false, false))) keep();
    robot.home();
  }
  // Goes on for some ms; whether there is anything new.
  reach.more = ms => {
    if (reach.done) return false;
    const before = [robot.goal, robot.delta_a, robot.lambda_a, robot.x_e].map(view => view.slice()), until = performance.now() + ms;
    const count = reach.places.length;
    while (!reach.done && performance.now() < until) reach.done = Boolean(work.next().done);
    [robot.goal, robot.delta_a, robot.lambda_a, robot.x_e].forEach((view, i) => view.set(before[i]));
    return reach.places.length > count;
  };
  reach.more(reach.lines ? Infinity : 120); // the net moves the controller along: it is done at once
  return reach;
}
