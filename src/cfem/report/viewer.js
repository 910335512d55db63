// Draws the robots of this page: depth-sorted triangles on a canvas, played, scrubbed and turned by the reader.
// The data's format is described in viewer.py.
(() => {
  "use strict";
  const BODY = { 0: [64, 134, 196], 1: [84, 94, 108], 2: [224, 168, 89] };
  const PALE = { ...BODY, 0: [176, 190, 204] };
  const LAMP = [-0.3496, 0.5494, 0.7591];
  const BINS = 4096;

  const decode = (text, Type) => {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return new Type(bytes.buffer);
  };
  const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  // A length of so many mm, with the unit that suits it, as cfem.core.shown gives it.
  const long = mm => {
    if (mm === null) return "unknown";
    if (mm > 0 && mm < 1e-6) return "< 1 nm";
    const [unit, one] = [["mm", 1], ["µm", 1e-3], ["nm", 1e-6]].find(([, one]) => !mm || mm >= 0.1 * one) ?? ["nm", 1e-6];
    return `${Number((mm / one).toPrecision(2))} ${unit}`;
  };

  function start(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const triangles = decode(data.triangles, Uint32Array), kinds = decode(data.kinds, Uint8Array);
    const takes = data.takes.map(take => ({ ...take, frames: decode(take.frames, Int16Array) }));
    const nodes = takes[0].frames.length / 3 / takes[0].count, count = triangles.length / 3;
    const view = new Float32Array(3 * nodes), depth = new Float32Array(count), shade = new Float32Array(count);
    const order = new Uint32Array(count), shown = new Uint32Array(count);
    const palette = data.pale ? PALE : BODY, paints = {};
    const canvas = document.createElement("canvas"), brush = canvas.getContext("2d");
    let take = takes[0], time = 0, playing = false, last = 0, visible = true, axes, fit, turned = [...data.camera];

    const aim = () => {
      const [a, e] = turned.map(value => value * Math.PI / 180);
      const towards = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)], right = [-Math.sin(a), Math.cos(a), 0];
      const up = [0, 1, 2].map(i => towards[(i + 1) % 3] * right[(i + 2) % 3] - towards[(i + 2) % 3] * right[(i + 1) % 3]);
      axes = [right, up, towards];
      // What all frames cover, from every third node of each.
      const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
      const cover = p => { for (let d = 0; d < 2; d++) { const v = dot(axes[d], p); low[d] = Math.min(low[d], v); high[d] = Math.max(high[d], v); } };
      const all = take.frames;
      for (let i = 0; i < all.length; i += 9) cover([0, 1, 2].map(d => data.origin[d] + data.step * all[i + d]));
      for (const goal of take.goals) cover(goal);
      for (const line of take.lines) for (const frame of line.frames) frame.forEach(cover);
      fit = { low, high };
    };
    const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    const between = () => {
      const first = Math.floor(time) % take.count, second = (first + 1) % take.count, share = time - Math.floor(time);
      return [first, take.closed || second > first ? second : first, share];
    };
    const mix = (u, v, share) => u.map((value, i) => value + share * (v[i] - value));

    function draw() {
      const wide = canvas.clientWidth, ratio = Math.min(window.devicePixelRatio || 1, 2), pad = 18;
      const size = [fit.high[0] - fit.low[0], fit.high[1] - fit.low[1]];
      const tall = Math.round(Math.min(wide * Math.min(Math.max(size[1] / size[0] || 1, 0.55), 1.05), 500));
      if (!wide) return;
      if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(tall * ratio)) {
        canvas.width = Math.round(wide * ratio); canvas.height = Math.round(tall * ratio); canvas.style.height = tall + "px";
      }
      const scale = Math.min((wide - 2 * pad) / size[0], (tall - 2 * pad - 16) / size[1]);
      const left = (wide - scale * size[0]) / 2 - scale * fit.low[0], base = (tall - 16 + scale * size[1]) / 2 + scale * fit.low[1];
      const screen = p => [left + scale * dot(axes[0], p), base - scale * dot(axes[1], p)];
      brush.setTransform(ratio, 0, 0, ratio, 0, 0);
      brush.clearRect(0, 0, wide, tall);
      body(left, base, scale);
      brush.lineJoin = brush.lineCap = "round";
      overlay(screen);
      bar(wide, tall, scale);
    }

    function body(left, base, scale) {
      const [first, second, share] = between(), all = take.frames, u = 3 * nodes * first, v = 3 * nodes * second;
      const [r, up, t] = axes, { origin, step } = data;
      for (let i = 0; i < 3 * nodes; i += 3) {
        const x = origin[0] + step * (all[u + i] + share * (all[v + i] - all[u + i]));
        const y = origin[1] + step * (all[u + i + 1] + share * (all[v + i + 1] - all[u + i + 1]));
        const z = origin[2] + step * (all[u + i + 2] + share * (all[v + i + 2] - all[u + i + 2]));
        view[i] = left + scale * (r[0] * x + r[1] * y + r[2] * z);
        view[i + 1] = base - scale * (up[0] * x + up[1] * y + up[2] * z);
        view[i + 2] = scale * (t[0] * x + t[1] * y + t[2] * z);
      }
      let front = 0, near = -Infinity, far = Infinity;
      for (let k = 0; k < count; k++) {
        const a = 3 * triangles[3 * k], b = 3 * triangles[3 * k + 1], c = 3 * triangles[3 * k + 2];
        const bx = view[b] - view[a], by = view[a + 1] - view[b + 1], bz = view[b + 2] - view[a + 2];
        const cx = view[c] - view[a], cy = view[a + 1] - view[c + 1], cz = view[c + 2] - view[a + 2];
        const nz = bx * cy - by * cx;
        if (nz <= 0) continue;
        const nx = by * cz - bz * cy, ny = bz * cx - bx * cz;
        const lit = (nx * LAMP[0] + ny * LAMP[1] + nz * LAMP[2]) / Math.hypot(nx, ny, nz);
        shade[k] = 0.55 + 0.45 * Math.max(lit, 0);
        depth[k] = view[a + 2] + view[b + 2] + view[c + 2];
        near = Math.max(near, depth[k]); far = Math.min(far, depth[k]);
        shown[front++] = k;
      }
      // From far to near, by counting sort.
      const starts = new Uint32Array(BINS + 1), width = (near - far) / (BINS - 1) || 1;
      for (let i = 0; i < front; i++) starts[Math.floor((depth[shown[i]] - far) / width) + 1]++;
      for (let i = 0; i < BINS; i++) starts[i + 1] += starts[i];
      for (let i = 0; i < front; i++) order[starts[Math.floor((depth[shown[i]] - far) / width)]++] = shown[i];
      brush.lineWidth = 0.7;
      for (let i = 0; i < front; i++) {
        const k = order[i], a = 3 * triangles[3 * k], b = 3 * triangles[3 * k + 1], c = 3 * triangles[3 * k + 2];
        const paint = (kinds[k] << 6) + Math.min(Math.round(63 * shade[k]), 63);
        brush.fillStyle = brush.strokeStyle = paints[paint] ??= `rgb(${palette[kinds[k]].map(one => Math.round(one * shade[k])).join(",")})`;
        brush.beginPath();
        brush.moveTo(view[a], view[a + 1]); brush.lineTo(view[b], view[b + 1]); brush.lineTo(view[c], view[c + 1]);
        brush.closePath(); brush.fill(); brush.stroke();
      }
    }

    function overlay(screen) {
      const [first, second, share] = between(), path = (points, style, width) => {
        brush.strokeStyle = style; brush.lineWidth = width; brush.beginPath();
        points.map(screen).forEach(([x, y], i) => i ? brush.lineTo(x, y) : brush.moveTo(x, y)); brush.stroke();
      };
      const disc = (p, radius, fill, edge, width = 1.2) => {
        const [x, y] = screen(p);
        brush.beginPath(); brush.arc(x, y, radius, 0, 2 * Math.PI); brush.fillStyle = fill; brush.fill();
        brush.strokeStyle = edge; brush.lineWidth = width; brush.stroke();
      };
      for (const line of take.lines) {
        const points = line.frames[Math.min(first, line.frames.length - 1)].map((p, i) => mix(p, line.frames[Math.min(second, line.frames.length - 1)][i], share));
        path(points, colour("--card"), 4); path(points, colour(line.colour), 2.2);
        points.forEach(p => disc(p, 2.6, colour(line.colour), colour("--card"), 0.8));
      }
      for (const one of take.marks) disc(one.point, 5, colour(one.colour), colour("--card"), 1.5);
      if (!take.goals.length) return;
      for (const goal of take.goals) disc(goal, 3.4, colour("--card"), colour("--ink"));
      path((take.closed ? [...take.reached, take.reached[0]] : take.reached).filter(Boolean), colour("--hot"), 1.8);
      const [from, to] = [first, second].map(i => take.reached[take.index[i]]);
      if (from && to) disc(mix(from, to, share), 5.5, colour("--hot"), colour("--card"), 1.5);
    }

    function bar(wide, tall, scale) {
      let size = 10 ** Math.floor(Math.log10(wide / scale / 3));
      size *= [5, 2, 1].find(k => k * size <= wide / scale / 3);
      const x = 14, y = tall - 8;
      brush.strokeStyle = colour("--faint"); brush.lineWidth = 3; brush.lineCap = "butt";
      brush.beginPath(); brush.moveTo(x, y); brush.lineTo(x + size * scale, y); brush.stroke();
      brush.fillStyle = colour("--soft"); brush.font = "11px system-ui, sans-serif"; brush.textAlign = "left";
      brush.fillText(`${size} mm`, x + size * scale + 6, y + 4);
    }

    const controls = document.createElement("div"), play = document.createElement("button"), slide = document.createElement("input");
    const said = document.createElement("output"), choice = document.createElement("select");
    const tell = () => {
      const goal = take.index[Math.round(time) % take.count];
      slide.value = time; play.textContent = playing ? "❚❚" : "▶"; play.setAttribute("aria-label", playing ? "pause" : "play");
      said.textContent = `goal ${goal + 1} of ${take.goals.length}, error ${long(take.errors[goal])}`;
    };
    const end = () => take.closed ? take.count : take.count - 1;
    let forth = 1;
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
      take = takes[one]; time = 0; forth = 1; slide.max = end(); aim(); draw(); if (take.goals.length) tell();
    };

    if (takes[0].goals.length) {
      controls.className = "controls"; play.type = "button"; slide.type = "range"; slide.min = 0; slide.step = 0.02;
      slide.setAttribute("aria-label", "place along the curve");
      takes.forEach((one, i) => choice.add(new Option(one.name.replaceAll("-", " "), i)));
      choice.setAttribute("aria-label", "trajectory");
      controls.append(play, slide, ...(takes.length > 1 ? [choice] : []), said);
      play.onclick = () => go(!playing);
      slide.oninput = () => { playing = false; time = Number(slide.value); draw(); tell(); };
      choice.onchange = () => choose(Number(choice.value));
    }
    figure.querySelector("img").replaceWith(canvas);
    canvas.after(controls);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", figure.querySelector("figcaption").textContent);
    let held = null;
    canvas.onpointerdown = event => { held = [event.clientX, event.clientY, ...turned]; canvas.setPointerCapture(event.pointerId); };
    canvas.onpointermove = event => {
      if (!held) return;
      const tilt = event.pointerType === "mouse" ? held[3] + 0.4 * (event.clientY - held[1]) : held[3];
      turned = [held[2] - 0.5 * (event.clientX - held[0]), Math.min(Math.max(tilt, -89), 89)];
      aim(); draw();
    };
    canvas.onpointerup = canvas.onpointercancel = () => { held = null; };
    new ResizeObserver(draw).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    choose(0);
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
    try { start(figure); } catch (error) { console.error(error); } // the still picture stays
  }
  // A table that is wider than the screen says that it goes on to the right.
  for (const box of document.querySelectorAll(".scroll")) {
    const hint = document.createElement("small"), look = () => box.classList.toggle("more", box.scrollWidth - box.clientWidth - box.scrollLeft > 2);
    hint.className = "hint"; hint.textContent = "The table goes on: scroll it sideways →"; hint.setAttribute("aria-hidden", "true");
    box.after(hint);
    box.addEventListener("scroll", look);
    new ResizeObserver(look).observe(box);
  }
  // A link of the table of contents opens the part that it leads to.
  const open = () => { const part = document.getElementById(location.hash.slice(1)); if (part instanceof HTMLDetailsElement) { part.open = true; part.scrollIntoView(); } };
  addEventListener("hashchange", open);
  document.querySelectorAll("nav a").forEach(link => link.addEventListener("click", () => setTimeout(open)));
  addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(part => { part.open = true; }));
  open();
})();
