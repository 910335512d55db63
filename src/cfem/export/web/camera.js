// Vectors, and where the eye is: azimuth and elevation in degrees (z is up; azimuth 0 looks from +x), the height of the view in mm,
// and its centre.
const add = (u, v, s = 1) => [u[0] + s * v[0], u[1] + s * v[1], u[2] + s * v[2]];
const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
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

const MARGIN = { top: 64, bottom: 76, side: 28 }; // pixels: the buttons above; the hint, the scale and a weight below
const AZIMUTHS = [40, 22, 58, -22, -40, -58, 75, -75, 105, -105, 122, 140, 158, -122, -140, -158];

// The whole body and the reach in the middle of a canvas of wide x tall pixels, seen from where the reach is wide and the body is not
// foreshortened.
function firstCamera(body, reach, wide, tall) {
  const all = [...body, ...reach], world = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const whole = extent(all, world), long = Math.hypot(...extent(body, world).size) || 1;
  const camera = { azimuth: 40, elevation: 14, height: 1, centre: [0, 0, 0], size: Math.hypot(...whole.size) || 1 };
  let best = 0;
  for (const azimuth of AZIMUTHS) {
    const { right, up } = axesOf({ ...camera, azimuth }), seen = extent(all, [right, up]).size, own = extent(body, [right, up]).size;
    const score = seen[0] * seen[1] * (Math.hypot(...own) / long) ** 2;
    if (score > 1.02 * best) { best = score; camera.azimuth = azimuth; }
  }
  const { right, up, towards } = axesOf(camera), { low, high, size } = extent(all, [right, up, towards]);
  const room = [Math.max(wide - 2 * MARGIN.side, 60), Math.max(tall - MARGIN.top - MARGIN.bottom, 60)];
  const scale = Math.max(size[0] / room[0], size[1] / room[1]) || 1; // mm a pixel
  camera.height = scale * tall;
  const middle = low.map((value, k) => (value + high[k]) / 2);
  middle[1] += scale * (MARGIN.top - MARGIN.bottom) / 2;
  camera.centre = add(add(add([0, 0, 0], right, middle[0]), up, middle[1]), towards, middle[2]);
  return camera;
}
