// Draws the robot with WebGL: its body, with what is inside showing through; where it rests, pale; the ground with the
// robot's shadow; the reach of the tip; goal and tip.
const LIGHT = [0.22, -0.16]; // how far a shadow falls aside, of the height above the ground
const SIDES = 8, LATITUDES = [-0.99, -0.8, -0.45, 0, 0.45, 0.8, 0.99];

// Triangles of tubes along points, or of balls about lone ones: places and normals, refilled by `clear` and `add`.
function makeTubes() {
  const tubes = { place: new Float32Array(3 << 10), normal: new Float32Array(3 << 10), used: 0 };
  const ring = { place: new Float32Array(3 * SIDES), normal: new Float32Array(3 * SIDES) };
  const turns = Array.from({ length: SIDES }, (_, k) => [Math.cos(2 * Math.PI * k / SIDES), Math.sin(2 * Math.PI * k / SIDES)]);
  const before = { place: new Float32Array(3 * SIDES), normal: new Float32Array(3 * SIDES) };
  const copy = (from, k) => {
    for (let i = 0; i < 3; i++, tubes.used++) { tubes.place[tubes.used] = from.place[3 * k + i]; tubes.normal[tubes.used] = from.normal[3 * k + i]; }
  };
  tubes.clear = () => { tubes.used = 0; };
  tubes.add = (points, radius) => {
    const lone = points.length === 1, places = lone ? LATITUDES.map(h => add(points[0], [0, 0, radius * h])) : points;
    const needed = tubes.used + 18 * SIDES * places.length;
    if (needed > tubes.place.length) for (const name of ["place", "normal"]) {
      const more = new Float32Array(2 * needed);
      more.set(tubes[name]); tubes[name] = more;
    }
    let side = null;
    places.forEach((at, i) => {
      const way = unit(add(places[Math.min(i + 1, places.length - 1)], places[Math.max(i - 1, 0)], -1));
      side = unit(cross(way, side ? cross(side, way) : Math.abs(way[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
      const other = cross(way, side), share = lone ? Math.sqrt(1 - LATITUDES[i] ** 2) : 1, rise = lone ? LATITUDES[i] : 0;
      before.place.set(ring.place); before.normal.set(ring.normal);
      turns.forEach(([c, s], k) => {
        for (let d = 0; d < 3; d++) {
          const n = c * side[d] + s * other[d];
          ring.place[3 * k + d] = at[d] + radius * share * n;
          ring.normal[3 * k + d] = share * n + rise * way[d];
        }
      });
      for (let k = 0; i && k < SIDES; k++) {
        const next = (k + 1) % SIDES;
        copy(before, k); copy(before, next); copy(ring, k); copy(ring, k); copy(before, next); copy(ring, next);
      }
    });
  };
  return tubes;
}

// rest: the robot's places and normals at rest; ground: height of the ground (mm).
function makeScene(canvas, robot, rest, ground) {
  const software = inSoftware(), gl = canvas.getContext("webgl", { antialias: !software, alpha: false, stencil: true });
  if (!gl || !gl.getExtension("OES_element_index_uint")) throw new Error("This page needs WebGL, which this browser lacks or has switched off, so nothing is drawn.");
  const tubes = makeTubes(), grid = gridOf(rest.place, ground);
  let surface, mark, buffers, reach = { places: [], count: 0, lines: false };

  // Once, and again after the graphics card has let go of the page.
  function load() {
    gl.getExtension("OES_element_index_uint");
    surface = makeProgram(gl, SURFACE); mark = makeProgram(gl, MARK);
    const names = ["place", "normal", "triangles", "tubes", "tubeNormals", "loose", "reach", "restPlace", "restNormal", "grid"];
    buffers = Object.fromEntries(names.map(name => [name, gl.createBuffer()]));
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(robot.triangles), gl.STATIC_DRAW);
    for (const [name, data] of [["restPlace", rest.place], ["restNormal", rest.normal], ["grid", grid]]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    }
    gl.enableVertexAttribArray(0);
    gl.clearDepth(1);
    setReach(reach.places, reach.lines);
  }

  const feed = (slot, buffer, data) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    if (data) gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 0, 0);
  };

  function frame(camera) {
    const wide = canvas.clientWidth, tall = canvas.clientHeight, ratio = Math.min(window.devicePixelRatio || 1, 2) * (camera.sharpness ?? 1);
    const columns = Math.max(1, Math.round(wide * ratio)), rows = Math.max(1, Math.round(tall * ratio));
    const { right, up, towards } = axesOf(camera), scale = 2 / camera.height, aspect = wide / tall || 1, depth = 20 * camera.size;
    const row = (axis, s) => [axis[0] * s, axis[1] * s, axis[2] * s, -dot(axis, camera.centre) * s];
    const [x, y, z] = [row(right, scale / aspect), row(up, scale), row(towards, -2 / depth)];
    return { wide, tall, ratio, columns, rows, x, y, z, right, up, towards };
  }

  const project = (camera, p) => {
    const f = frame(camera), to = r => r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3];
    return [(to(f.x) + 1) / 2 * f.wide, (1 - to(f.y)) / 2 * f.tall];
  };

  const drawBody = () => {
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.drawElements(gl.TRIANGLES, robot.triangles.length, gl.UNSIGNED_INT, 0);
  };

  // The ground seen from above: a grid, and the shadow, each pixel of it once.
  function drawGround(f, theme) {
    if (f.towards[2] <= 0) return;
    gl.useProgram(mark.program);
    gl.uniformMatrix4fv(mark.view, false, matrixOf(f));
    gl.disableVertexAttribArray(1);
    gl.disable(gl.CULL_FACE); gl.enable(gl.BLEND); gl.depthMask(false);
    gl.uniform1i(mark.kind, PLAIN);
    gl.uniform4f(mark.paint, ...theme.ink, 0.09);
    feed(0, buffers.grid);
    gl.drawArrays(gl.LINES, 0, grid.length / 3);
    const [a, b] = LIGHT, flat = r => [r[0], r[1], -r[0] * a - r[1] * b, (r[0] * a + r[1] * b + r[2]) * ground + r[3]];
    gl.uniformMatrix4fv(mark.view, false, matrixOf({ x: flat(f.x), y: flat(f.y), z: flat(f.z) }));
    gl.uniform4f(mark.paint, 0, 0, 0, 0.16);
    gl.enable(gl.STENCIL_TEST); gl.stencilFunc(gl.EQUAL, 0, 255); gl.stencilOp(gl.KEEP, gl.INCR, gl.INCR);
    gl.disable(gl.DEPTH_TEST);
    feed(0, buffers.place, robot.drawn);
    drawBody();
    gl.disable(gl.STENCIL_TEST); gl.enable(gl.DEPTH_TEST); gl.depthMask(true);
  }

  // Where the robot rests, behind what it does now.
  function drawRest(theme) {
    gl.enable(gl.BLEND); gl.depthMask(false);
    gl.uniform4f(surface.paint, ...theme.ink, 0.07);
    gl.uniform4f(surface.rim, ...theme.ink, 0.35);
    feed(0, buffers.restPlace);
    feed(1, buffers.restNormal);
    drawBody();
    gl.depthMask(true);
  }

  function drawSurfaces(lines, theme, ghost) {
    gl.enableVertexAttribArray(1);
    gl.enable(gl.CULL_FACE); gl.disable(gl.BLEND);
    gl.uniform4f(surface.rim, ...theme.rim, 0.45);
    gl.uniform4f(surface.paint, ...theme.body, 1);
    feed(0, buffers.place, robot.drawn);
    feed(1, buffers.normal, robot.normals);
    drawBody();
    if (ghost) drawRest(theme);
    // What is inside shows through: in full where nothing hides it, else fainter.
    if (!lines.length) return;
    tubes.clear();
    const ends = lines.map(([points, radius]) => { tubes.add(points, radius); return tubes.used / 3; });
    feed(0, buffers.tubes, tubes.place.subarray(0, tubes.used));
    feed(1, buffers.tubeNormals, tubes.normal.subarray(0, tubes.used));
    gl.uniform4f(surface.rim, 0, 0, 0, 0);
    for (const [alpha, depth] of [[0.65, gl.GREATER], [1, gl.LEQUAL]]) {
      (alpha < 1 ? gl.enable : gl.disable).call(gl, gl.BLEND);
      gl.depthFunc(depth); gl.depthMask(alpha === 1);
      lines.forEach(([, , colour], i) => {
        const begin = i ? ends[i - 1] : 0;
        gl.uniform4f(surface.paint, ...colour, alpha);
        gl.drawArrays(gl.TRIANGLES, begin, ends[i] - begin);
      });
    }
  }

  function drawMarks(f, marks, theme) {
    const look = (kind, size, paint, rim = [0, 0, 0, 0]) => {
      gl.uniform1i(mark.kind, kind); gl.uniform1f(mark.size, size * f.ratio);
      gl.uniform4f(mark.paint, ...paint); gl.uniform4f(mark.rim, ...rim);
    };
    gl.disableVertexAttribArray(1);
    gl.disable(gl.CULL_FACE); gl.enable(gl.BLEND); gl.depthMask(false);
    if (reach.count && marks.reach) {
      feed(0, buffers.reach);
      look(reach.lines ? PLAIN : DISC, 4, [...theme.reach, 0.85], [...theme.reach, 0.85]);
      gl.drawArrays(reach.lines ? gl.LINES : gl.POINTS, 0, reach.count);
    }
    gl.disable(gl.DEPTH_TEST);
    for (const { goal, tip } of marks.points) {
      feed(0, buffers.loose, new Float32Array([...tip, ...goal]));
      look(PLAIN, 1, [...theme.ink, 0.7]);
      gl.drawArrays(gl.LINES, 0, 2);
      look(DISC, 13, [...theme.ink, 1], [...theme.ground, 1]);
      gl.drawArrays(gl.POINTS, 0, 1);
      look(TARGET, 34, [...theme.goal, 1]);
      gl.drawArrays(gl.POINTS, 1, 1);
    }
    gl.enable(gl.DEPTH_TEST); gl.depthMask(true);
  }

  // lines: [points, radius, colour]; marks: whether the reach is shown, and goals with their tips; theme: colours; ghost: whether the
  // robot has left its place of rest; plain: neither that nor the ground, for a machine that draws slowly.
  function draw(camera, lines, marks, theme, ghost, plain) {
    const f = frame(camera), { right, up, towards } = f;
    if (canvas.width !== f.columns || canvas.height !== f.rows) { canvas.width = f.columns; canvas.height = f.rows; }
    gl.viewport(0, 0, f.columns, f.rows);
    gl.clearColor(...theme.ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (!plain) drawGround(f, theme);
    gl.useProgram(surface.program);
    gl.uniformMatrix4fv(surface.view, false, matrixOf(f));
    gl.uniformMatrix3fv(surface.turn, false, [right[0], up[0], towards[0], right[1], up[1], towards[1], right[2], up[2], towards[2]]);
    drawSurfaces(lines, theme, ghost && !plain);
    gl.depthFunc(gl.LEQUAL); gl.depthMask(true);
    gl.useProgram(mark.program);
    gl.uniformMatrix4fv(mark.view, false, matrixOf(f));
    drawMarks(f, marks, theme);
  }

  // places: flat; lines: pairs of them, or else points.
  function setReach(places, lines) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.reach);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(places), gl.STATIC_DRAW);
    reach = { places, count: places.length / 3, lines };
  }

  load();
  return { draw, project, setReach, load, gl, software };
}

// Of rows x, y, z, column after column.
const matrixOf = ({ x, y, z }) => [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, x[3], y[3], z[3], 1];

// Lines on the ground under places (flat), a round number of mm apart.
function gridOf(places, height) {
  const { low, high, size } = extent(places, [[1, 0, 0], [0, 1, 0]]), wide = Math.max(...size, ...extent(places, [[0, 0, 1]]).size) || 1;
  const digit = 10 ** Math.floor(Math.log10(wide / 4)), apart = digit * [1, 2, 5, 10].find(k => k * digit >= wide / 6), lines = [];
  const [x, y] = low.map((value, k) => Math.round((value + high[k]) / 2 / apart) * apart), half = Math.ceil(0.75 * wide / apart) * apart;
  for (let d = -half; d <= half + 1e-9; d += apart) {
    lines.push(x + d, y - half, height, x + d, y + half, height, x - half, y + d, height, x + half, y + d, height);
  }
  return new Float32Array(lines);
}
