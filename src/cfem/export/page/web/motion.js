// The robot in motion: its goal runs round a curve, and two robots follow it, one under the static inverse, one under predictive
// control, which both are computed at each tick.
const RUNNING = ["static", "predictive"], TRAIL = 120, MOST_TICKS = 8; // points of a trail; ticks a picture, where it comes late
const LAP = [[0.85, 0.45, 0.1], [0.13, 0.55, 0.3]]; // colours of their trails

function makeMotion(robot) {
  const { said, curve } = robot.moves, n_e = robot.n_e, count = curve.length / n_e;
  const at = phase => { // between two points of the curve
    const place = (phase - Math.floor(phase)) * count, i = Math.floor(place) % count, j = (i + 1) % count, share = place - Math.floor(place), out = [];
    for (let e = 0; e < n_e; e++) out.push((1 - share) * curve[i * n_e + e] + share * curve[j * n_e + e]);
    return out;
  };
  const state = { speed: 0, asked: 0, phase: 0, late: 0, shown: 1, lost: 0, trails: [[], []], missed: [[], []] };
  const lap = [];
  for (let k = 0; k <= count; k += 2) lap.push(at(k / count).slice(0, 3));
  function start() {
    robot.moves.start();
    Object.assign(state, { speed: 0, phase: 0, late: 0, lost: 0, trails: [[], []], missed: [[], []] });
  }
  // One tick; the speed follows the slider within about a second, which a robot can follow.
  function tick() {
    const step = said.dt * state.asked, all = state.asked ? Math.max(4, Math.round(1 / step)) : 1;
    state.speed += Math.max(-1, Math.min(1, (state.asked - state.speed) / (said.dt * said.most))) * said.dt * said.most;
    const goal = [];
    for (let k = 1; k <= said.ticks; k++) goal.push(at(state.phase + k * said.dt * state.speed));
    state.lost = robot.moves.tick(goal, state.shown);
    state.phase += said.dt * state.speed;
    robot.goal.set(goal[0]);
    const even = Math.max(1, Math.round(all / TRAIL));
    state.ticks = (state.ticks ?? 0) + 1;
    RUNNING.forEach((name, which) => {
      if (state.lost >> which & 1) return;
      const place = robot.moves.place(which);
      state.missed[which].push(Math.hypot(...[0, 1, 2].map(e => place[e] - goal[0][e])));
      if (state.missed[which].length > all) state.missed[which].splice(0, state.missed[which].length - all);
      if (state.ticks % even === 0) state.trails[which].push(place.slice(0, 3));
      if (state.trails[which].length > all / even) state.trails[which].splice(0, state.trails[which].length - Math.round(all / even));
    });
  }
  // What is due of a picture that comes `seconds` after the last.
  function run(seconds) {
    state.late = Math.min(state.late + seconds, MOST_TICKS * said.dt);
    while (state.late >= said.dt && state.lost < 3) { state.late -= said.dt; tick(); }
  }
  const mean = list => list.reduce((sum, one) => sum + one, 0) / (list.length || 1);
  const missed = which => [mean(state.missed[which]), Math.max(0, ...state.missed[which])];
  // Points, pixels and colour of each line to draw.
  const lines = theme => [[lap, 1.2, theme.goal], ...state.trails.map((trail, which) => [trail, which === state.shown ? 2.6 : 1.6, LAP[which]]).filter(one => one[0].length > 1)];
  return { state, start, tick, run, missed, lines, at };
}

// Its part of the panel. begin and end: what else the page does then.
function motionPanel(motion, robot, begin, end, again) {
  const slider = $("speed"), { state } = motion, { said } = robot.moves;
  $("motion").hidden = false;
  Object.assign(slider, { min: 0, max: said.most, step: said.most / 100, value: 0 });
  const names = { static: "static inverse", predictive: "predictive" }, words = speed => speed ? `${short(speed)} laps a second` : "at rest";
  const show = () => {
    RUNNING.forEach((name, which) => $(`by-${name}`).setAttribute("aria-pressed", String(state.shown === which)));
    $("laps").textContent = slider.ariaValueText = words(state.asked);
    $("missed").hidden = !state.asked;
    RUNNING.forEach((name, which) => motion.missed(which).forEach((value, column) => {
      $("missed").tBodies[0].rows[which].cells[column + 1].textContent = state.missed[which].length ? short(value) : "";
    }));
    const gone = RUNNING.filter((name, which) => state.lost >> which & 1).map(name => names[name]);
    $("lost").textContent = gone.length ? `Lost: ${gone.join(" and ")}. At this speed the robot leaves the states that its model knows. Set the speed to 0 to begin again.` : "";
  };
  slider.addEventListener("input", () => {
    const from = state.asked;
    state.asked = Number(slider.value);
    if (state.asked && !from) { begin(); motion.start(); }
    if (!state.asked && from) end();
    show(); again();
  });
  RUNNING.forEach((name, which) => { $(`by-${name}`).onclick = () => { state.shown = which; show(); again(); }; });
  show();
  return { show, stop() { slider.value = state.asked = 0; show(); } };
}
