// Draws the robot with WebGL: its body, with what is inside showing through; the reach of the tip; goal and tip.
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

function makeScene(canvas, robot) {
  const software = inSoftware(), gl = canvas.getContext("webgl", { antialias: !software, alpha: false });
  if (!gl || !gl.getExtension("OES_element_index_uint")) throw new Error("This page needs WebGL, which this browser lacks or has switched off, so nothing is drawn.");
  const surface = makeProgram(gl, SURFACE), mark = makeProgram(gl, MARK), tubes = makeTubes();
  const buffers = Object.fromEntries(["place", "normal", "triangles", "tubes", "tubeNormals", "loose", "reach"].map(name => [name, gl.createBuffer()]));
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(robot.triangles), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.clearDepth(1);
  let reach = { count: 0, lines: false };

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

  function drawSurfaces(lines, theme) {
    gl.enableVertexAttribArray(1);
    gl.enable(gl.CULL_FACE); gl.disable(gl.BLEND);
    gl.uniform4f(surface.rim, ...theme.rim, 0.45);
    gl.uniform4f(surface.paint, ...theme.body, 1);
    feed(0, buffers.place, robot.drawn);
    feed(1, buffers.normal, robot.normals);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.drawElements(gl.TRIANGLES, robot.triangles.length, gl.UNSIGNED_INT, 0);
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
      look(reach.lines ? PLAIN : DISC, 3, [...theme.reach, 0.4], [...theme.reach, 0.4]);
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

  // lines: [points, radius, colour]; marks: whether the reach is shown, and goals with their tips; theme: colours.
  function draw(camera, lines, marks, theme) {
    const f = frame(camera), { x, y, z, right, up, towards } = f;
    if (canvas.width !== f.columns || canvas.height !== f.rows) { canvas.width = f.columns; canvas.height = f.rows; }
    gl.viewport(0, 0, f.columns, f.rows);
    gl.clearColor(...theme.ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const view = [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, x[3], y[3], z[3], 1];
    gl.useProgram(surface.program);
    gl.uniformMatrix4fv(surface.view, false, view);
    gl.uniformMatrix3fv(surface.turn, false, [right[0], up[0], towards[0], right[1], up[1], towards[1], right[2], up[2], towards[2]]);
    drawSurfaces(lines, theme);
    gl.depthFunc(gl.LEQUAL); gl.depthMask(true);
    gl.useProgram(mark.program);
    gl.uniformMatrix4fv(mark.view, false, view);
    drawMarks(f, marks, theme);
  }

  // places: flat; lines: pairs of them, or else points.
  function setReach(places, lines) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.reach);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(places), gl.STATIC_DRAW);
    reach = { count: places.length / 3, lines };
  }

  return { draw, project, setReach, gl, software };
}
