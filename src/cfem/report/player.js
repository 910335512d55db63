// The robots of a report: played, scrubbed and turned by the reader. viewer.py describes the data.
const KINDS = [[64, 134, 196], [84, 94, 108], [224, 168, 89]], GREY = [176, 190, 204]; // as in viewer.py
const MOST = 15000; // points by which a picture is framed
const MARGIN = { top: 16, bottom: 34, side: 18 }, TUBE = 0.006; // pixels; radius of a cable, of the robot's size

const decode = (text, Type) => {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Type(bytes.buffer);
};
// A length of so many mm, with the unit that suits it, as cfem.core.console.shown gives it.
const long = mm => {
  if (mm === null) return "unknown";
  if (mm > 0 && mm < 1e-6) return "< 1 nm";
  const [unit, one] = [["mm", 1], ["µm", 1e-3], ["nm", 1e-6]].find(([, one]) => !mm || mm >= 0.1 * one) ?? ["nm", 1e-6];
  return `${Number((mm / one).toPrecision(2))} ${unit}`;
};

// The shapes of the data: `at(take, time)` puts the one at that time into the sheets, one of each kind of triangles.
function makeShapes(data) {
  const triangles = decode(data.triangles, Uint32Array), kinds = decode(data.kinds, Uint8Array), again = decode(data.again, Uint32Array);
  const takes = data.takes.map(take => ({ ...take, frames: decode(take.frames, Int16Array) }));
  const nodes = takes[0].frames.length / 3 / takes[0].count, place = new Float32Array(3 * (nodes + again.length)), normal = new Float32Array(place.length);
  const bodies = [0, 1, 2].map(kind => {
    const mine = [];
    kinds.forEach((one, k) => { if (one === kind) mine.push(...triangles.subarray(3 * k, 3 * k + 3)); });
    return { sheet: makeSheet(Uint32Array.from(mine), place, normal), paints: [(kind || !data.pale ? KINDS[kind] : GREY).map(value => value / 255)] };
  }).filter(one => one.sheet.triangles.length);
  const neighbours = (take, time) => {
    const first = Math.floor(time) % take.count, second = (first + 1) % take.count;
    return [first, take.closed || second > first ? second : first, time - Math.floor(time)];
  };
  const at = (take, time) => {
    const [first, second, share] = neighbours(take, time), u = 3 * nodes * first, v = 3 * nodes * second, all = take.frames;
    for (let i = 0; i < 3 * nodes; i++) place[i] = data.origin[i % 3] + data.step * (all[u + i] + share * (all[v + i] - all[u + i]));
    again.forEach((node, k) => place.copyWithin(3 * (nodes + k), 3 * node, 3 * node + 3));
    normalsOf(place, triangles, normal);
  };
  // What all frames of a take cover, from some of many points.
  const cover = take => {
    const places = [], every = 3 * Math.ceil(take.frames.length / 3 / MOST);
    for (let i = 0; i < take.frames.length; i += every) for (let d = 0; d < 3; d++) places.push(data.origin[d] + data.step * take.frames[i + d]);
    for (const line of take.lines) for (const frame of line.frames) places.push(...frame.flat());
    return places.concat(take.goals.flat());
  };
  return { takes, bodies, at, cover, neighbours };
}

function play(figure) {
  const data = JSON.parse(figure.querySelector("script").textContent), shapes = makeShapes(data), { takes } = shapes;
  const canvas = document.createElement("canvas"), stage = document.createElement("div"), scene = makeScene(canvas, () => draw()), turned = [...data.camera];
  let take = takes[0], time = 0, playing = false, last = 0, visible = true, covered = [], camera = null, forth = 1;

  // The camera that shows all frames, and the canvas as tall as they need.
  function aim() {
    const wide = canvas.clientWidth, { right, up } = axesOf({ azimuth: turned[0], elevation: turned[1] }), { size } = extent(covered, [right, up]);
    const tall = Math.round(Math.min(wide * Math.min(Math.max(size[1] / size[0] || 1, 0.55), 1.05), 500));
    canvas.style.height = `${tall}px`;
    camera = framed(covered, ...turned, wide, tall, MARGIN);
    draw();
  }
  function draw() {
    if (!canvas.clientWidth) return;
    const [first, second, share] = shapes.neighbours(take, time);
    const theme = { rim: [1, 1, 1], ink: styled("--ink") };
    const inside = take.lines.map(line => {
      const [from, to] = [first, second].map(k => line.frames[Math.min(k, line.frames.length - 1)]);
      return { sheet: tubeSheet(from.map((p, i) => between(p, to[i], share)), TUBE * camera.size), paint: styled(line.colour) };
    });
    shapes.at(take, time);
    scene.draw(camera, { theme, bodies: shapes.bodies, inside, ghost: null, ground: null, marks: (brush, screen) => mark(brush, screen, first, second, share) });
    overlay(camera);
  }

  function mark(brush, screen, first, second, share) {
    const [card, ink, hot] = ["--card", "--ink", "--hot"].map(name => css(styled(name)));
    for (const one of take.marks) disc(brush, screen, one.point, 5, css(styled(one.colour)), card, 1.5);
    if (!take.goals.length) return;
    for (const goal of take.goals) disc(brush, screen, goal, 3.4, card, ink, 1.2);
    path(brush, screen, (take.closed ? [...take.reached, take.reached[0]] : take.reached).filter(Boolean), hot, 1.8);
    const [from, to] = [first, second].map(i => take.reached[take.index[i]]);
    if (from && to) disc(brush, screen, between(from, to, share), 5.5, hot, card, 1.5);
  }

  const controls = document.createElement("div"), button = document.createElement("button"), slide = document.createElement("input");
  const said = document.createElement("output"), choice = document.createElement("select");
  const tell = () => {
    const goal = take.index[Math.round(time) % take.count];
    slide.value = time; button.textContent = playing ? "❚❚" : "▶"; button.setAttribute("aria-label", playing ? "pause" : "play");
    said.textContent = `goal ${goal + 1} of ${take.goals.length}, error ${long(take.errors[goal])}`;
  };
  const end = () => take.closed ? take.count : take.count - 1;
  const tick = now => {
    if (!playing || !visible) return;
    // Six goals a second or so, one round in four seconds at least; there and back where the curve is open.
    time += forth * Math.min(Math.max(now - last, 0) / 1000, 0.1) * Math.min(6, end() / 4);
    last = now;
    if (take.closed) time %= take.count;
    else if (time >= end() || time <= 0) { time = Math.min(Math.max(time, 0), end()); forth = time > 0 ? -1 : 1; }
    draw(); tell(); requestAnimationFrame(tick);
  };
  const go = on => { playing = on; last = performance.now(); tell(); if (on) requestAnimationFrame(tick); };
  const choose = one => {
    take = takes[one]; time = 0; forth = 1; slide.max = end(); covered = shapes.cover(take); aim(); if (take.goals.length) tell();
  };

  if (takes[0].goals.length) {
    controls.className = "controls"; button.type = "button"; slide.type = "range"; slide.min = 0; slide.step = 0.02;
    slide.setAttribute("aria-label", "place along the curve");
    takes.forEach((one, i) => choice.add(new Option(one.name.replaceAll("-", " "), i)));
    choice.setAttribute("aria-label", "trajectory");
    controls.append(button, slide, ...(takes.length > 1 ? [choice] : []), said);
    button.onclick = () => go(!playing);
    slide.oninput = () => { playing = false; time = Number(slide.value); draw(); tell(); };
    choice.onchange = () => choose(Number(choice.value));
  }
  stage.className = "stage";
  stage.append(canvas);
  figure.querySelector("img").replaceWith(stage);
  stage.after(controls);
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", figure.querySelector("figcaption").textContent);
  const overlay = makeOverlay(canvas);
  let held = null;
  canvas.onpointerdown = event => { held = [event.clientX, event.clientY, ...turned]; canvas.setPointerCapture(event.pointerId); };
  canvas.onpointermove = event => {
    if (!held) return;
    const tilt = event.pointerType === "mouse" ? held[3] + 0.4 * (event.clientY - held[1]) : held[3];
    turned.splice(0, 2, held[2] - 0.5 * (event.clientX - held[0]), Math.min(Math.max(tilt, -89), 89));
    aim();
  };
  canvas.onpointerup = canvas.onpointercancel = () => { held = null; };
  choose(0);
  new ResizeObserver(aim).observe(stage);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  if (take.goals.length) {
    new IntersectionObserver(([entry]) => {
      const back = entry.isIntersecting && !visible;
      visible = entry.isIntersecting;
      if (back && playing) go(true);
    }).observe(canvas);
    go(take.count > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches);
  }
}

for (const figure of document.querySelectorAll(".viewer")) {
  try { play(figure); } catch (error) { console.error(error); } // the still picture stays
}
