// The page: what the pointer, the keys and the sliders do, and what is said.
const $ = id => document.getElementById(id);
const TICKS = 6; // a frame, until the robot stands still
const MOST = 600; // ticks for one goal: where several actuations are as good, the last digits take their time
const COLOURS = [[0.27, 0.45, 0.77], [0.16, 0.63, 0.62], [0.55, 0.76, 0.29], [0.97, 0.77, 0.23], [0.90, 0.29, 0.18]];
const MARGIN = { top: 64, bottom: 76, side: 28 }; // pixels: the buttons above; the hint, the scale and a weight below
const FAINT = 0.3; // of a part of the reach that the robot hides
const SLACK = [0.55, 0.58, 0.62];

function colourOf(share) {
  const at = Math.min(Math.max(share, 0), 1) * (COLOURS.length - 1), i = Math.min(Math.floor(at), COLOURS.length - 2);
  return COLOURS[i].map((value, k) => value + (at - i) * (COLOURS[i + 1][k] - value));
}

const themeColours = () => Object.fromEntries(["ground", "body", "rim", "reach", "goal", "ink"].map(name => [name, styled(`--${name}`)]));

function start(robot) {
  const { said } = robot, canvas = $("view"), overlay = makeOverlay(canvas);
  const state = { byHand: false, status: 0, moving: true, theme: themeColours(), camera: null, dragged: null, still: 0, ticks: 0, quick: false, shown: true, lit: null, weight: 0, strain: null };
  let reach = makeReach(robot);
  robot.home();
  robot.shape();
  const rest = { place: robot.drawn.slice(), normal: robot.normals.slice() };
  const lowest = extent([...rest.place, ...reach.places], [[0, 0, 1]]).low[0];
  const again = () => { state.shown = true; };
  const scene = makeScene(canvas, again), outer = robot.triangles.subarray(0, 3 * said.outer), level = lowest - 0.02 * said.length;
  const body = makeSheet(outer, robot.drawn, robot.normals), ghost = makeSheet(outer, rest.place, rest.normal);
  const ground = { height: level, lines: gridOf(rest.place, level) }, chambers = makeChambers(robot, rest.place), strain = makeStrain(robot, rest.place);

  // All that the first view shows: the body where it stands and where it gets, what it reaches, and its shadow.
  const seen = () => {
    const body = [...outermost(robot.drawn), ...reach.outermost], all = [...body, ...reach.places];
    for (let i = 0; i < body.length; i += 3) all.push(...shadowOf(body, i, level));
    return all;
  };
  const view = () => framed(seen(), bestAzimuth(robot.drawn, reach.places), 14, canvas.clientWidth, canvas.clientHeight, MARGIN);
  const lookAtAll = () => { state.camera = view(); state.whole = JSON.stringify(state.camera); };
  lookAtAll();

  const goals = said.points.map(one => ({ ...one, get place() { return [...robot.goal.slice(...one.rows)]; }, get tip() { return [...robot.x_e.slice(...one.rows)]; } }));
  const missed = () => Math.max(...goals.map(one => Math.hypot(...add(one.place, one.tip, -1))));
  const wake = () => { state.moving = true; state.still = state.ticks = 0; state.shown = true; };
  const follow = () => { stop(); if (state.byHand) { state.byHand = false; showMode(); } wake(); };
  function moveGoal(one, place) { robot.goal.set(place, one.rows[0]); follow(); }

  // --- the panel
  const rows = said.actuators.map((actuator, i) => {
    const box = document.createElement("div"), by = said.command === "force";
    const [low, high] = by ? [actuator.lambda[0] ?? 0, actuator.lambda[1] ?? actuator.scale] : actuator.delta;
    box.className = "actuator";
    box.innerHTML = `<label for="a${i}"><b></b><span></span></label><input id="a${i}" type="range"><em></em>`;
    box.querySelector("b").textContent = actuator.name;
    const slider = box.querySelector("input");
    Object.assign(slider, { min: low, max: high, step: (high - low) / 1000 });
    slider.addEventListener("input", () => {
      stop();
      state.byHand = true;
      const before = [[...robot.delta_a], [...robot.lambda_a]];
      const status = robot.set(rows.map(one => Number(one.slider.value)), by);
      if (status & ~STATUS.OUTSIDE) {
        robot.delta_a.set(before[0]); robot.lambda_a.set(before[1]);
        slider.value = by ? robot.lambda_a[i] : robot.delta_a[i];
      }
      else for (const one of goals) robot.goal.set(one.tip, one.rows[0]);
      state.status = status;
      showMode(); wake();
    });
    const light = on => () => { state.lit = on ? i : null; again(); };
    box.onpointerenter = slider.onfocus = light(true);
    box.onpointerleave = slider.onblur = light(false);
    $("actuators").append(box);
    return { slider, box, said: box.querySelector("span"), limit: box.querySelector("em"), by };
  });
  for (const [kind, { title }] of Object.entries(KINDS)) {
    const one = said.actuators.find(each => each.kind === kind);
    if (!one) continue;
    const legend = document.createElement("div");
    legend.innerHTML = "<h2></h2><div class=\"legend\"><span>0</span><div></div><span></span></div>";
    legend.firstChild.textContent = title;
    legend.querySelector(".legend div").style.background = `linear-gradient(to right, ${COLOURS.map(one => css(one)).join(", ")})`;
    legend.querySelector(".legend span:last-child").textContent = `${short(one.scale * one.forceFactor, 1)} ${one.forceUnit}`;
    $("legends").append(legend);
  }

  // A weight that hangs from the first point. The reach is found again when the slider is let go.
  function hang() {
    stop();
    const slider = $("weight"), asked = Number(slider.value), share = state.weight = robot.weigh(asked);
    $("heavy").textContent = Math.abs(asked - share) > 1e-9 ? "The model knows no heavier weight here." : "";
    if ($("heavy").textContent) slider.value = share;
    $("grams").textContent = slider.ariaValueText = weightOf(share * said.weight);
    if (state.byHand) for (const one of goals) robot.goal.set(one.tip, one.rows[0]);
    wake();
  }
  if (said.weight) {
    $("load").hidden = false;
    $("grams").textContent = weightOf(0);
    $("weight").addEventListener("input", hang);
    $("weight").addEventListener("change", () => {
      const by = said.command === "force", there = by ? [...robot.lambda_a] : [...robot.delta_a], goal = [...robot.goal];
      reach = makeReach(robot);
      robot.set(there, by); robot.goal.set(goal);
      wake();
    });
  }

  function showMode() {
    $("follow").setAttribute("aria-pressed", String(!state.byHand));
    $("hand").setAttribute("aria-pressed", String(state.byHand));
  }

  // In motion, without a weight: a curve that the goal runs round by itself.
  const motion = robot.moves && makeMotion(robot);
  const moving = () => Boolean(motion && motion.state.asked);
  const leave = () => { robot.home(); wake(); };
  const panel = motion && motionPanel(motion, robot, () => {
    if (state.weight) { $("weight").value = 0; hang(); }
    state.byHand = false; showMode();
  }, leave, wake);
  const stop = () => { if (moving()) { panel.stop(); robot.home(); } };

  let lastSaid = "";
  function tell() {
    const limits = [], binding = !state.byHand && !moving() && missed() > 0.01;
    said.actuators.forEach((actuator, i) => {
      const row = rows[i], limit = limitOf(actuator, robot.delta_a[i], robot.lambda_a[i]);
      // A slack cable is longer than its way: what the slider says is told to its drive, the rest hangs.
      const told = state.byHand && !row.by ? Number(row.slider.value) : robot.delta_a[i], spare = robot.delta_a[i] - told;
      const hangs = limit === "slack" && spare > 1e-3 * (actuator.delta[1] - actuator.delta[0]);
      row.said.textContent = `${short(hangs ? told : robot.delta_a[i])} ${actuator.unit} · ${short(robot.lambda_a[i] * actuator.forceFactor)} ${actuator.forceUnit}`;
      row.limit.textContent = hangs ? `slack by ${short(spare)} ${actuator.unit}` : limit;
      row.limit.className = binding && limit ? "binding" : "";
      row.box.style.setProperty("--force", css(forceColour(i)));
      if (!state.byHand) row.slider.value = row.by ? robot.lambda_a[i] : robot.delta_a[i];
      row.slider.setAttribute("aria-valuetext", row.said.textContent + (limit ? `, ${limit}` : ""));
      if (limit) limits.push([actuator.name, limit]);
    });
    const [kind, words] = sentence(state.status, missed(), state.quick && !state.byHand, state.byHand, limits, said.actuators.length, moving());
    if (words !== lastSaid) { lastSaid = $("words").textContent = words; $("status").className = kind; }
    $("note").textContent = aside(state.status);
    goals.forEach((one, k) => [one.place, one.tip].forEach((place, column) => place.forEach((value, i) => {
      $("places").tBodies[k].rows[i].cells[column + 1].textContent = short(value);
    })));
  }
  const forceColour = i => { const share = robot.lambda_a[i] / said.actuators[i].scale; return share <= 2e-3 ? SLACK : colourOf(share); };
  for (const one of goals) {
    const body = document.createElement("tbody");
    "xyz".split("").forEach(axis => { body.insertRow().innerHTML = `<th scope="row">${goals.length > 1 ? `<span></span> ` : ""}${axis}</th><td></td><td></td>`; });
    if (goals.length > 1) body.querySelectorAll("span").forEach(span => { span.textContent = one.name; });
    $("places").append(body);
  }

  // --- every frame
  let busy = 0, played = 0, grown = 0;
  function frame(now) {
    requestAnimationFrame(frame);
    const begin = performance.now(), more = reach.more(8);
    // The reach alone is drawn again from time to time.
    if (!state.shown && (reach.done ? more : now - grown > 400)) { grown = now; state.shown = true; }
    if (!state.shown) return;
    if (moving()) {
      motion.run(Math.min(0.001 * (now - played), 0.1));
      state.status = 0;
      state.shown = state.moving = true;
      panel.show();
    } else if (state.moving && !state.byHand) step(said.paced ? 1 : TICKS);
    played = now;
    robot.shape();
    for (const one of chambers) one.inflate();
    draw();
    tell();
    if (state.byHand) state.moving = false;
    state.shown = state.moving || state.dragged !== null;
    busy = performance.now() - begin;
  }
  function step(most) {
    const from = goals.map(one => one.tip);
    for (let k = 0; k < most; k++) {
      const before = [...robot.delta_a];
      state.status = robot.tick();
      const stays = before.every((value, i) => Math.abs(value - robot.delta_a[i]) <= said.tolerance[i]);
      state.still = stays ? state.still + 1 : 0;
      if (state.still > 1 || ++state.ticks > MOST) { state.moving = false; break; }
    }
    state.quick = state.moving && Math.max(...goals.map((one, i) => Math.hypot(...add(one.tip, from[i], -1)))) > 1e-4 * said.length;
    state.shown = true;
  }
  function draw(sharp = false) {
    const { theme } = state, size = said.length;
    const inside = said.lines.map(line => {
      const points = [];
      for (let p = line.first; p < line.first + line.count; p++) points.push([...robot.drawn.subarray(3 * p, 3 * p + 3)]);
      return { sheet: tubeSheet(points, line.radius * (line.actuator === state.lit ? 1.7 : 1)), paint: forceColour(line.actuator) };
    });
    for (const { actuator, sheet } of chambers) inside.push({ sheet, paint: forceColour(actuator).map(value => actuator === state.lit ? 0.5 + 0.5 * value : value) });
    if (state.weight) {
      const [x, y, z] = goals[0].tip, end = [x, y, z - 0.07 * size];
      inside.push({ sheet: tubeSheet([[x, y, z], end], 0.003 * size), paint: theme.ink }, { sheet: tubeSheet([end], 0.03 * size * Math.cbrt(state.weight)), paint: theme.ink });
    }
    body.level = state.strain ? strain.levels(state.strain) : null;
    scene.draw(state.camera, { theme, bodies: [{ sheet: body, paints: state.strain ? STRAINED : [theme.body] }], inside, ghost: moved() ? ghost : null, ground, marks }, sharp);
    overlay(state.camera);
  }
  function marks(brush, screen, hidden) {
    const { theme } = state;
    if (pressed("reach")) for (const [alpha, seen] of [[FAINT, false], [0.9, true]]) {
      const style = css(theme.reach, alpha);
      if (reach.lines) strokes(brush, screen, reach.places, style, 1, (p, q) => hidden(between(p, q, 0.5)) === seen);
      else dots(brush, screen, reach.places, style, 1.8, p => hidden(p) === seen);
    }
    if (moving()) for (const [points, width, colour] of motion.lines(theme)) path(brush, screen, points, css(colour), width);
    for (const { place, tip } of goals) {
      strokes(brush, screen, [...tip, ...place], css(theme.ink, 0.7), 1);
      disc(brush, screen, tip, 5.5, css(theme.ink), css(theme.ground), 1.8);
      target(brush, screen, place, css(theme.goal));
    }
  }
  // Whether a point of the surface has left its place of rest by so much that two robots can be told apart.
  const moved = () => { const apart = 0.03 * said.length; return rest.place.some((value, k) => Math.abs(value - robot.drawn[k]) > apart); };
  const pressed = id => $(id).getAttribute("aria-pressed") === "true";
  const toggle = id => $(id).setAttribute("aria-pressed", String(!pressed(id)));
  canvas.addEventListener("pointerdown", () => { $("hint").classList.add("known"); });

  pointers(canvas, scene, state, goals, moveGoal, again);
  keys(canvas, state, goals, moveGoal, again);
  $("follow").onclick = () => { follow(); showMode(); again(); };
  $("hand").onclick = () => { stop(); state.byHand = true; showMode(); wake(); again(); };
  $("home").onclick = () => { robot.home(); follow(); again(); };
  $("camera").onclick = () => { lookAtAll(); again(); };
  $("reach").onclick = () => { toggle("reach"); again(); };
  $("strain").onclick = () => {
    toggle("strain");
    state.strain = pressed("strain") ? strain.scale() : null;
    $("strained").hidden = !state.strain;
    if (state.strain) $("strained").querySelector("span:last-child").textContent = `${short(100 * state.strain, state.strain < 0.1 ? 1 : 0)} %`;
    again();
  };
  $("strained").querySelector(".legend div").style.background = `linear-gradient(to right, ${STRAINED.map(one => css(one)).join(", ")})`;
  $("theme").onclick = () => {
    const root = document.documentElement, dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    state.theme = themeColours(); again();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { state.theme = themeColours(); again(); });
  // Another width would cut the robot off; a view that a person has chosen stays.
  new ResizeObserver(() => { if (JSON.stringify(state.camera) === state.whole) lookAtAll(); again(); }).observe(canvas);
  document.addEventListener("input", again);
  document.addEventListener("visibilitychange", again);
  showMode(); tell();
  requestAnimationFrame(frame);
  // For those who script the page, and for its tests.
  document.documentElement.dataset.state = "ready";
  window.cfem = { robot, motion, state, scene, ground, shadowOf, goals, chambers, strain, moveGoal, step, draw, STATUS, busy: () => busy };
}

function trouble(words) {
  $("page").hidden = true;
  $("trouble").hidden = false;
  $("trouble").textContent = words;
  document.documentElement.dataset.state = "trouble";
}

addEventListener("DOMContentLoaded", async () => {
  try {
    const data = await unpack($("robot"));
    $("trouble").hidden = true;
    $("page").hidden = false;
    start(await makeRobot(data));
  } catch (error) { console.error(error); trouble(error instanceof TypeError || error instanceof RangeError || error instanceof ReferenceError ? CUT : error.message); }
});
