// Vectors, colours, and where the eye is: azimuth and elevation in degrees (z is up; azimuth 0 looks from +x), the height of the view in mm,
// and its centre.
const add = (u, v, s = 1) => [u[0] + s * v[0], u[1] + s * v[1], u[2] + s * v[2]];
const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
const between = (u, v, share) => u.map((value, i) => value + share * (v[i] - value));
const unit = v => { const l = Math.hypot(...v) || 1; return [v[0] / l, v[1] / l, v[2] / l]; };

function axesOf(camera) {
  const a = camera.azimuth * Math.PI / 180, e = camera.elevation * Math.PI / 180;
  const towards = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)], right = [-Math.sin(a), Math.cos(a), 0];
  return { right, up: cross(towards, right), towards };
}

// Smallest and largest coordinate of places (flat) along each axis.
function extent(places, axes) {
  const low = axes.map(() => Infinity), high = axes.map(() => -Infinity);
  for (let i = 0; i < places.length; i += 3) axes.forEach((axis, k) => {
    const at = axis[0] * places[i] + axis[1] * places[i + 1] + axis[2] * places[i + 2];
    if (at < low[k]) low[k] = at;
    if (at > high[k]) high[k] = at;
  });
  return { low, high, size: high.map((value, k) => Math.max(value - low[k], 0)) };
}

// Of places (flat), those that lie farthest in each of 26 directions, flat.
const DIRECTIONS = [-1, 0, 1].flatMap(x => [-1, 0, 1].flatMap(y => [-1, 0, 1].map(z => [x, y, z]))).filter(axis => axis.some(Boolean));
function outermost(places) {
  const far = DIRECTIONS.map(() => -Infinity), index = DIRECTIONS.map(() => 0);
  for (let i = 0; i < places.length; i += 3) DIRECTIONS.forEach(([x, y, z], k) => {
    const at = x * places[i] + y * places[i + 1] + z * places[i + 2];
    if (at > far[k]) { far[k] = at; index[k] = i; }
  });
  return [...new Set(index)].flatMap(i => [places[i], places[i + 1], places[i + 2]]);
}

const AZIMUTHS = [40, 22, 58, -22, -40, -58, 75, -75, 105, -105, 122, 140, 158, -122, -140, -158];

const WORLD = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

// From where the reach is wide and the body is not foreshortened.
function bestAzimuth(body, reach) {
  const all = [...body, ...reach], long = Math.hypot(...extent(body, WORLD).size) || 1;
  let best = 0, found = 40;
  for (const azimuth of AZIMUTHS) {
    const { right, up } = axesOf({ azimuth, elevation: 14 }), seen = extent(all, [right, up]).size, own = extent(body, [right, up]).size;
    const score = seen[0] * seen[1] * (Math.hypot(...own) / long) ** 2;
    if (score > 1.02 * best) { best = score; found = azimuth; }
  }
  return found;
}

// The camera that shows places (flat) in the middle of a canvas of wide x tall pixels; margin: pixels at its top, bottom and sides.
function framed(places, azimuth, elevation, wide, tall, margin) {
  const camera = { azimuth, elevation, height: 1, centre: [0, 0, 0], size: Math.hypot(...extent(places, WORLD).size) || 1 };
  const { right, up, towards } = axesOf(camera), { low, high, size } = extent(places, [right, up, towards]);
  const room = [Math.max(wide - 2 * margin.side, 60), Math.max(tall - margin.top - margin.bottom, 60)];
  const scale = Math.max(size[0] / room[0], size[1] / room[1]) || 1; // mm a pixel
  camera.height = scale * tall;
  const middle = low.map((value, k) => (value + high[k]) / 2);
  middle[1] += scale * (margin.top - margin.bottom) / 2;
  camera.centre = add(add(add([0, 0, 0], right, middle[0]), up, middle[1]), towards, middle[2]);
  return camera;
}

// A colour of the page's style, #rgb or #rrggbb, as three numbers from 0 to 1.
function styled(name) {
  const hex = getComputedStyle(document.documentElement).getPropertyValue(name).trim().slice(1), long = hex.length > 3;
  return [0, 1, 2].map(k => parseInt(long ? hex.slice(2 * k, 2 * k + 2) : hex[k] + hex[k], 16) / 255);
}
