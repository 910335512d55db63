// How light falls on a surface: a table of colours by the x and y of the normal that faces the reader, computed once for a
// paint. A pixel's colour is then one look-up, at a normal that changes smoothly over each triangle.
const TONES = 128; // columns and rows of a page of the table
const LAMP = unit([-0.42, 0.55, 0.72]), GLOSS = unit(add(LAMP, [0, 0, 1]));

// paints: colours (0 to 1) of the pages, one for a plain surface, more for a scale; rim: colour and strength of the light that
// falls past the edges; alpha: of the face, where the surface is pale.
function makeTable(paints, rim = [1, 1, 1, 0], alpha = 1) {
  const table = new Uint32Array(paints.length * TONES * TONES), byte = value => Math.round(255 * Math.min(Math.max(value, 0), 1));
  for (let row = 0, i = 0; row < TONES; row++) for (let column = 0; column < TONES; column++, i++) {
    let n = [(column + 0.5) / TONES * 2 - 1, (row + 0.5) / TONES * 2 - 1, 0];
    const square = n[0] ** 2 + n[1] ** 2;
    n = square < 1 ? [n[0], n[1], Math.sqrt(1 - square)] : unit(n);
    const lit = 0.66 + 0.36 * Math.max(dot(n, LAMP), 0) + 0.08 * n[1], gloss = 0.10 * Math.max(dot(n, GLOSS), 0) ** 30;
    const aside = 1 - n[2], edge = aside * aside * (0.3 + 0.7 * aside), glow = edge * rim[3];
    const seen = byte(alpha + (1 - alpha) * 0.6 * edge);
    paints.forEach((paint, page) => {
      const [r, g, b] = paint.map((value, k) => byte((value * lit + gloss) * (1 - glow) + rim[k] * glow));
      table[page * TONES * TONES + i] = (seen << 24 | b << 16 | g << 8 | r) >>> 0;
    });
  }
  return table;
}

// Tables by what they are made of, the last ones kept.
function makeTables(most = 48) {
  const kept = new Map();
  return (...paint) => {
    const key = JSON.stringify(paint);
    if (!kept.has(key)) {
      if (kept.size >= most) kept.delete(kept.keys().next().value);
      kept.set(key, makeTable(...paint));
    }
    return kept.get(key);
  };
}
