// Triangles as pixels, computed by the processor: a picture needs no graphics card and is the same on every machine.
// Depth is the place towards the reader: what is nearer is larger.
const FAR = -Infinity;
const SOLID = 0, PALE = 1, FLAT = 2; // hides what is behind; is blended where nothing solid is; covers each pixel once

// Pixels of a part of the canvas: colour (RGBA, red in the lowest byte) and depth, row after row.
function makeRaster() {
  const raster = { left: 0, top: 0, wide: 0, tall: 0, colour: new Uint32Array(0), depth: new Float32Array(0) };
  raster.clear = (left, top, wide, tall) => {
    Object.assign(raster, { left, top, wide, tall });
    const count = wide * tall;
    if (count > raster.colour.length) { raster.colour = new Uint32Array(1.2 * count); raster.depth = new Float32Array(1.2 * count); }
    raster.colour.fill(0, 0, count);
    raster.depth.fill(FAR, 0, count);
  };
  // nearness: of what covers a place in pixels; FAR where nothing does.
  raster.nearness = (x, y) => {
    const column = Math.floor(x) - raster.left, row = Math.floor(y) - raster.top;
    return column < 0 || row < 0 || column >= raster.wide || row >= raster.tall ? FAR : raster.depth[row * raster.wide + column];
  };
  return raster;
}

// Colours of `table` at the tones of the front faces of a sheet: { triangles, at: x, y, depth of each point in pixels, tones:
// its column, row and page of the table, flipped: whether the backs are the fronts }. mode: SOLID, PALE or FLAT.
function fill(raster, { triangles, at, tones, flipped }, table, mode) {
  const { left, top, wide, tall, colour, depth } = raster, way = flipped ? -1 : 1;
  for (let k = 0; k < triangles.length; k += 3) {
    const a = 3 * triangles[k], b = 3 * triangles[k + 1], c = 3 * triangles[k + 2];
    const ax = at[a] - left, ay = at[a + 1] - top, bx = at[b] - left, by = at[b + 1] - top, cx = at[c] - left, cy = at[c + 1] - top;
    const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    if (area * way >= 0) continue; // y points down, so that fronts turn this way
    const low = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5)), high = Math.min(tall, Math.ceil(Math.max(ay, by, cy) - 0.5));
    if (low >= high) continue;
    // Slopes along x and y of what is linear on the triangle.
    const p1 = (cy - ay) / area, p2 = (ax - cx) / area, q1 = (ay - by) / area, q2 = (bx - ax) / area;
    const zb = at[b + 2] - at[a + 2], zc = at[c + 2] - at[a + 2], zx = zb * p1 + zc * q1, zy = zb * p2 + zc * q2;
    const ub = tones[b] - tones[a], uc = tones[c] - tones[a], ux = ub * p1 + uc * q1, uy = ub * p2 + uc * q2;
    const vb = tones[b + 1] - tones[a + 1], vc = tones[c + 1] - tones[a + 1], vx = vb * p1 + vc * q1, vy = vb * p2 + vc * q2;
    const sb = tones[b + 2] - tones[a + 2], sc = tones[c + 2] - tones[a + 2], sx = sb * p1 + sc * q1, sy = sb * p2 + sc * q2;
    for (let row = low; row < high; row++) {
      // Between the two edges that this row of pixel centres crosses.
      const h = row + 0.5;
      let first = Infinity, last = -Infinity;
      if (ay <= h !== by <= h) { const x = ax + (h - ay) * (bx - ax) / (by - ay); first = x; last = x; }
      if (by <= h !== cy <= h) { const x = bx + (h - by) * (cx - bx) / (cy - by); if (x < first) first = x; if (x > last) last = x; }
      if (cy <= h !== ay <= h) { const x = cx + (h - cy) * (ax - cx) / (ay - cy); if (x < first) first = x; if (x > last) last = x; }
      const from = Math.max(0, Math.ceil(first - 0.5)), end = row * wide + Math.min(wide, Math.ceil(last - 0.5));
      let i = row * wide + from;
      if (mode === FLAT) { if (i < end) colour.fill(table[0], i, end); continue; }
      const dx = from + 0.5 - ax, dy = h - ay;
      let z = at[a + 2] + dx * zx + dy * zy, u = tones[a] + dx * ux + dy * uy, v = tones[a + 1] + dx * vx + dy * vy, s = tones[a + 2] + dx * sx + dy * sy;
      for (; i < end; i++) {
        if (mode === SOLID ? z > depth[i] : depth[i] === FAR) {
          const tone = table[((s | 0) * TONES + (v | 0)) * TONES + (u | 0)];
          if (mode === SOLID) { depth[i] = z; colour[i] = tone; }
          else colour[i] = blended(tone, colour[i], (tone >>> 24) / 255);
        }
        z += zx; u += ux; v += vx; s += sx;
      }
    }
  }
}

// A colour over another, of which `share` is seen.
function blended(over, under, share) {
  const rest = (under >>> 24) / 255 * (1 - share), whole = share + rest, w = share / whole;
  const mix = shift => Math.round(w * (over >>> shift & 255) + (1 - w) * (under >>> shift & 255)) << shift;
  return (Math.round(255 * whole) << 24 | mix(16) | mix(8) | mix(0)) >>> 0;
}

// What is inside of a body shows through: in full where nothing hides it, else `share` of it.
function showThrough(raster, inner, share) {
  const low = Math.max(raster.top, inner.top), high = Math.min(raster.top + raster.tall, inner.top + inner.tall);
  const first = Math.max(raster.left, inner.left), last = Math.min(raster.left + raster.wide, inner.left + inner.wide);
  for (let row = low; row < high; row++) {
    let i = (row - raster.top) * raster.wide + first - raster.left, j = (row - inner.top) * inner.wide + first - inner.left;
    for (let column = first; column < last; column++, i++, j++) {
      if (inner.depth[j] === FAR) continue;
      const seen = inner.depth[j] >= raster.depth[i];
      raster.colour[i] = seen ? inner.colour[j] : blended(inner.colour[j], raster.colour[i], share);
      if (seen) raster.depth[i] = inner.depth[j];
    }
  }
}
