// Draws robots on a 2-D canvas: bodies, with what is inside showing through; where they rest, pale; the ground with their
// shadow; and over it whatever the page marks.
const SHADOW = [0.22, -0.16]; // how far a shadow falls aside, of the height above the ground
const shadowOf = (places, i, ground) => [places[i] - SHADOW[0] * (places[i + 2] - ground), places[i + 1] - SHADOW[1] * (places[i + 2] - ground), ground];
const DARK = Math.round(255 * 0.15) << 24; // the shadow's colour
const THROUGH = 0.75; // of what is inside that its body lets through
const RIM = 3; // pixels
const SLOW = 14, QUICK = 6; // ms of a picture: beyond, the next has fewer pixels; below, more
const STANDING = 200; // ms after which a picture that stands is drawn with all of its pixels

// again: called when the picture should be drawn again.
function makeScene(canvas, again) {
  const brush = canvas.getContext("2d");
  if (!brush) throw new Error("This browser cannot draw on a canvas, so nothing is drawn.");
  const body = makeRaster(), inner = makeRaster(), tables = makeTables(), picture = document.createElement("canvas"), pen = picture.getContext("2d");
  let fineness = 2, full = false, standing = 0;

  // Pixels of the canvas, and how places (mm) fall on them; fine: pixels of the raster for each of the page.
  function frame(camera, fine = 1) {
    const wide = canvas.clientWidth, tall = canvas.clientHeight, scale = fine * tall / camera.height, { right, up, towards } = axesOf(camera);
    return { wide, tall, scale, right, up, towards, x: fine * wide / 2 - scale * dot(right, camera.centre), y: fine * tall / 2 + scale * dot(up, camera.centre) };
  }
  const onto = (f, p) => [f.x + f.scale * dot(f.right, p), f.y - f.scale * dot(f.up, p), f.scale * dot(f.towards, p)];

  // Points of a sheet on the raster, and the tones of their normals; grows `box`: left, top, right, bottom.
  function project(f, sheet, pages, box) {
    const { place, normal, level, at, tones } = sheet, { right: r, up: u, towards: t, scale } = f, half = TONES / 2, most = TONES - 0.01;
    const way = sheet.flipped ? -half : half;
    for (let i = 0; i < place.length; i += 3) {
      const x = place[i], y = place[i + 1], z = place[i + 2], a = normal[i], b = normal[i + 1], c = normal[i + 2];
      at[i] = f.x + scale * (r[0] * x + r[1] * y + r[2] * z);
      at[i + 1] = f.y - scale * (u[0] * x + u[1] * y + u[2] * z);
      at[i + 2] = scale * (t[0] * x + t[1] * y + t[2] * z);
      tones[i] = Math.min(Math.max(half + way * (r[0] * a + r[1] * b + r[2] * c), 0), most);
      tones[i + 1] = Math.min(Math.max(half + way * (u[0] * a + u[1] * b + u[2] * c), 0), most);
      tones[i + 2] = level ? Math.min(Math.max(level[i / 3], 0), 0.999) * pages : 0;
    }
    grow(box, at, sheet.triangles);
  }
  function grow(box, at, triangles) {
    for (let k = 0; k < triangles.length; k++) {
      const i = 3 * triangles[k], x = at[i], y = at[i + 1];
      if (x < box[0]) box[0] = x;
      if (y < box[1]) box[1] = y;
      if (x > box[2]) box[2] = x;
      if (y > box[3]) box[3] = y;
    }
  }
  // The part of a box that lies on the canvas becomes the raster's, with an empty rim: smoothing looks at the pixels beside it.
  function clear(raster, box, f, fine) {
    const left = Math.max(0, Math.floor(box[0]) - RIM), top = Math.max(0, Math.floor(box[1]) - RIM);
    const right = Math.min(Math.ceil(fine * f.wide), Math.ceil(box[2]) + RIM), bottom = Math.min(Math.ceil(fine * f.tall), Math.ceil(box[3]) + RIM);
    raster.clear(left, top, Math.max(right - left, 0), Math.max(bottom - top, 0));
  }

  // The sheets as their shadows on the ground.
  function cast(f, { sheet }, height, box) {
    const { place, triangles } = sheet;
    sheet.cast ??= new Float32Array(place.length);
    for (let i = 0; i < place.length; i += 3) {
      const p = onto(f, shadowOf(place, i, height));
      for (let d = 0; d < 3; d++) sheet.cast[i + d] = p[d];
    }
    grow(box, sheet.cast, triangles);
    return { triangles, at: sheet.cast, tones: sheet.tones };
  }

  function paintBodies(f, fine, { bodies, inside, ghost, ground, theme }) {
    const box = [Infinity, Infinity, -Infinity, -Infinity], within = [...box];
    for (const one of bodies) project(f, one.sheet, one.paints.length, box);
    for (const one of inside) project(f, one.sheet, 1, within);
    if (ghost) project(f, ghost, 1, box);
    const shadows = ground && f.towards[2] > 0 ? bodies.map(one => cast(f, one, ground.height, box)) : [];
    clear(body, [Math.min(box[0], within[0]), Math.min(box[1], within[1]), Math.max(box[2], within[2]), Math.max(box[3], within[3])], f, fine);
    for (const shadow of shadows) fill(body, shadow, [DARK], FLAT);
    for (const one of bodies) fill(body, one.sheet, tables(one.paints, [...theme.rim, 0.35]), SOLID);
    if (ghost) fill(body, ghost, tables([theme.ink], [...theme.ink, 0.6], 0.07), PALE);
    if (!inside.length) return;
    clear(inner, within, f, fine);
    for (const one of inside) fill(inner, one.sheet, tables([one.paint]), SOLID);
    showThrough(body, inner, THROUGH);
  }

  function show(f, fine, ratio, { ground, marks, theme }) {
    brush.setTransform(ratio, 0, 0, ratio, 0, 0);
    brush.clearRect(0, 0, f.wide, f.tall);
    brush.lineJoin = brush.lineCap = "round";
    const near = { ...f, scale: f.scale / fine, x: f.x / fine, y: f.y / fine }, screen = p => onto(near, p);
    if (ground && f.towards[2] > 0) strokes(brush, screen, ground.lines, css(theme.ink, 0.10), 1);
    if (body.wide && body.tall) {
      if (picture.width < body.wide || picture.height < body.tall) { picture.width = body.wide; picture.height = body.tall; }
      const bytes = new Uint8ClampedArray(body.colour.buffer, 0, 4 * body.wide * body.tall);
      pen.putImageData(new ImageData(bytes, body.wide, body.tall), 0, 0);
      brush.imageSmoothingQuality = "high";
      brush.drawImage(picture, 0, 0, body.wide, body.tall, body.left / fine, body.top / fine, body.wide / fine, body.tall / fine);
    }
    // Whether something is before a place.
    const hidden = p => { const [x, y, z] = screen(p); return body.nearness(fine * x, fine * y) > fine * z + 2 * fine; };
    marks(brush, screen, hidden);
  }

  // camera: see camera.js. scene: { theme: colours rim and ink; bodies: [{ sheet, paints }]; inside: [{ sheet, paint }];
  // ghost: a sheet or null; ground: { height, lines } or null; marks: what draws over it, given the brush, a function from
  // places to pixels and whether something hides a place }; sharp: with all pixels, however long that takes.
  function draw(camera, scene, sharp = false) {
    const wide = canvas.clientWidth, tall = canvas.clientHeight, ratio = Math.min(window.devicePixelRatio || 1, 2), begin = performance.now();
    if (!wide || !tall) return;
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(tall * ratio)) { canvas.width = Math.round(wide * ratio); canvas.height = Math.round(tall * ratio); }
    const whole = sharp || full, fine = whole ? 2 : fineness, f = frame(camera, fine);
    paintBodies(f, fine, scene);
    show(f, fine, ratio, scene);
    clearTimeout(standing);
    if (!whole) {
      const took = performance.now() - begin;
      if (took > SLOW) fineness = Math.max(0.6, 0.85 * fineness);
      else if (took < QUICK) fineness = Math.min(2, 1.05 * fineness);
      if (fine < 2) standing = setTimeout(() => { full = true; again(); }, STANDING);
    }
    full = false;
  }
  canvas.addEventListener("contextrestored", again);
  return { draw, project: (camera, p) => onto(frame(camera), p).slice(0, 2) };
}

// Lines on the ground under places (flat), a round number of mm apart.
function gridOf(places, height) {
  const { low, high, size } = extent(places, [[1, 0, 0], [0, 1, 0]]), wide = Math.max(...size, ...extent(places, [[0, 0, 1]]).size) || 1;
  const digit = 10 ** Math.floor(Math.log10(wide / 4)), apart = digit * [1, 2, 5, 10].find(k => k * digit >= wide / 6), lines = [];
  const [x, y] = low.map((value, k) => Math.round((value + high[k]) / 2 / apart) * apart), half = Math.ceil(0.75 * wide / apart) * apart;
  for (let d = -half; d <= half + 1e-9; d += apart) {
    lines.push(x + d, y - half, height, x + d, y + half, height, x - half, y + d, height, x + half, y + d, height);
  }
  return lines;
}
