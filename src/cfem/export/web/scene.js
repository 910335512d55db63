// Draws the robot with WebGL: its body, with what is inside showing through; the reach of the tip; goal and tip.
const VERTEX = `
attribute vec3 place, normal; attribute vec4 paint;
uniform mat4 view; uniform mat3 turn; uniform float size;
varying vec3 facing; varying vec4 colour;
void main() { gl_Position = view * vec4(place, 1.0); gl_PointSize = size; facing = turn * normal; colour = paint; }`;
const FRAGMENT = `
precision mediump float;
varying vec3 facing; varying vec4 colour;
uniform int kind; uniform vec4 edge;
void main() {
  vec4 c = colour;
  if (kind == 0) {
    vec3 n = normalize(facing);
    if (!gl_FrontFacing) n = -n;
    float lit = 0.62 + 0.30 * max(dot(n, normalize(vec3(-0.35, 0.6, 0.75))), 0.0) + 0.12 * n.y;
    float rim = pow(1.0 - abs(n.z), 2.5);
    c = vec4(mix(c.rgb * lit, edge.rgb, rim * edge.a), c.a + rim * (1.0 - c.a) * 0.6);
  } else if (kind == 2) {
    float r = 2.0 * length(gl_PointCoord - 0.5);
    if (r > 1.0) discard;
    c = r > 0.72 ? vec4(edge.rgb, c.a * smoothstep(1.0, 0.94, r)) : c;
  } else if (kind == 3) {
    float r = 2.0 * length(gl_PointCoord - 0.5), across = min(abs(gl_PointCoord.x - 0.5), abs(gl_PointCoord.y - 0.5));
    float ring = smoothstep(0.62, 0.68, r) * smoothstep(1.0, 0.94, r);
    float cross = step(across, 0.035) * step(r, 0.9);
    c.a *= max(ring, cross);
    if (c.a < 0.02) discard;
  }
  gl_FragColor = c;
}`;
const SIDES = 8;

const add = (u, v, s = 1) => [u[0] + s * v[0], u[1] + s * v[1], u[2] + s * v[2]];
const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
const unit = v => { const l = Math.hypot(...v) || 1; return [v[0] / l, v[1] / l, v[2] / l]; };

// Where the eye is: azimuth and elevation in degrees (z is up; azimuth 0 looks from +x), height of the view in mm, its centre.
function axesOf(camera) {
  const a = camera.azimuth * Math.PI / 180, e = camera.elevation * Math.PI / 180;
  const towards = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)], right = [-Math.sin(a), Math.cos(a), 0];
  return { right, up: cross(towards, right), towards };
}

// Whether WebGL has no graphics card here: smooth edges then cost twice the time.
function inSoftware() {
  const gl = document.createElement("canvas").getContext("webgl"), known = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = known ? gl.getParameter(known.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

function makeScene(canvas, robot) {
  const gl = canvas.getContext("webgl", { antialias: !inSoftware(), alpha: false });
  if (!gl || !gl.getExtension("OES_element_index_uint")) throw new Error("This page needs WebGL, which this browser lacks or has switched off, so nothing is drawn.");
  const compile = (type, text) => {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text); gl.compileShader(shader);
    return shader;
  };
  const program = gl.createProgram();
  gl.attachShader(program, compile(gl.VERTEX_SHADER, VERTEX));
  gl.attachShader(program, compile(gl.FRAGMENT_SHADER, FRAGMENT));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error("This browser's WebGL cannot run this page, so nothing is drawn.");
  gl.useProgram(program);
  const where = name => gl.getUniformLocation(program, name);
  const uniforms = { view: where("view"), turn: where("turn"), size: where("size"), kind: where("kind"), edge: where("edge") };
  const slots = { place: gl.getAttribLocation(program, "place"), normal: gl.getAttribLocation(program, "normal"), paint: gl.getAttribLocation(program, "paint") };
  const buffers = { place: gl.createBuffer(), normal: gl.createBuffer(), triangles: gl.createBuffer(), loose: gl.createBuffer(), looseNormal: gl.createBuffer(), loosePaint: gl.createBuffer(), reach: gl.createBuffer() };
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(robot.triangles), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(slots.place);
  let reach = { count: 0, lines: false };

  const feed = (slot, buffer, data, width = 3) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, width, gl.FLOAT, false, 0, 0);
  };
  const one = (slot, ...value) => { gl.disableVertexAttribArray(slot); gl[`vertexAttrib${value.length}f`](slot, ...value); };
  const look = (kind, size = 1, edge = [0, 0, 0, 0]) => { gl.uniform1i(uniforms.kind, kind); gl.uniform1f(uniforms.size, size); gl.uniform4fv(uniforms.edge, edge); };

  // A tube of triangles along points, or a ball about a lone one.
  function tube(points, radius, colour, out) {
    const lone = points.length === 1, heights = [-0.99, -0.8, -0.45, 0, 0.45, 0.8, 0.99];
    const radii = lone ? heights.map(h => radius * Math.sqrt(1 - h * h)) : points.map(() => radius);
    if (lone) points = heights.map(h => add(points[0], [0, 0, radius * h]));
    let side = null, last = null;
    for (let i = 0; i < points.length; i++) {
      const way = unit(add(points[Math.min(i + 1, points.length - 1)], points[Math.max(i - 1, 0)], -1));
      side = unit(cross(way, side ? cross(side, way) : Math.abs(way[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
      const other = cross(way, side), ring = [];
      for (let k = 0; k < SIDES; k++) {
        const angle = 2 * Math.PI * k / SIDES, n = add(side.map(v => v * Math.cos(angle)), other, Math.sin(angle));
        ring.push([add(points[i], n, radii[i]), lone ? unit(add(n, [0, 0, heights[i] / Math.sqrt(1 - heights[i] ** 2)])) : n]);
      }
      for (let k = 0; last && k < SIDES; k++) {
        const [a, b, c, d] = [last[k], last[(k + 1) % SIDES], ring[k], ring[(k + 1) % SIDES]];
        for (const [p, n] of [a, b, c, c, b, d]) { out.place.push(...p); out.normal.push(...n); out.paint.push(...colour); }
      }
      last = ring;
    }
  }

  function frame(camera) {
    const wide = canvas.clientWidth, tall = canvas.clientHeight, ratio = Math.min(window.devicePixelRatio || 1, 2) * (camera.sharpness ?? 1);
    const columns = Math.max(1, Math.round(wide * ratio)), rows = Math.max(1, Math.round(tall * ratio));
    if (canvas.width !== columns || canvas.height !== rows) { canvas.width = columns; canvas.height = rows; }
    const { right, up, towards } = axesOf(camera), scale = 2 / camera.height, aspect = wide / tall || 1, depth = 20 * camera.size;
    const row = (axis, s) => [axis[0] * s, axis[1] * s, axis[2] * s, -dot(axis, camera.centre) * s];
    const [x, y, z] = [row(right, scale / aspect), row(up, scale), row(towards, -2 / depth)];
    return { wide, tall, ratio, columns, rows, x, y, z, right, up, towards };
  }

  const project = (camera, p) => {
    const f = frame(camera), to = r => r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3];
    return [(to(f.x) + 1) / 2 * f.wide, (1 - to(f.y)) / 2 * f.tall];
  };

  // lines: [points, radius, colour]; marks: goal and tip, places and colours; theme: colours.
  function draw(camera, lines, marks, theme) {
    const f = frame(camera), { x, y, z } = f;
    gl.viewport(0, 0, f.columns, f.rows);
    gl.clearColor(...theme.ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL); gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.uniformMatrix4fv(uniforms.view, false, [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, x[3], y[3], z[3], 1]);
    gl.uniformMatrix3fv(uniforms.turn, false, [f.right[0], f.up[0], f.towards[0], f.right[1], f.up[1], f.towards[1], f.right[2], f.up[2], f.towards[2]]);

    gl.enable(gl.CULL_FACE);
    feed(slots.place, buffers.place, robot.drawn);
    feed(slots.normal, buffers.normal, robot.normals);
    one(slots.paint, ...theme.body, 1);
    look(0, 1, [...theme.rim, 0.45]);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.drawElements(gl.TRIANGLES, robot.triangles.length, gl.UNSIGNED_INT, 0);

    // What is inside shows through: in full where nothing hides it, else fainter.
    for (const [alpha, depth] of [[0.65, gl.GREATER], [1, gl.LEQUAL]]) {
      const out = { place: [], normal: [], paint: [] };
      for (const [points, radius, colour] of lines) tube(points, radius, [...colour, alpha], out);
      if (!out.place.length) break;
      gl.depthFunc(depth); gl.depthMask(depth === gl.LEQUAL);
      look(0);
      feed(slots.place, buffers.loose, new Float32Array(out.place));
      feed(slots.normal, buffers.looseNormal, new Float32Array(out.normal));
      feed(slots.paint, buffers.loosePaint, new Float32Array(out.paint), 4);
      gl.drawArrays(gl.TRIANGLES, 0, out.place.length / 3);
    }
    gl.depthFunc(gl.LEQUAL);
    gl.disable(gl.CULL_FACE);

    gl.depthMask(false);
    one(slots.normal, 0, 0, 1);
    if (reach.count && marks.reach) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers.reach);
      gl.enableVertexAttribArray(slots.place);
      gl.vertexAttribPointer(slots.place, 3, gl.FLOAT, false, 0, 0);
      look(reach.lines ? 1 : 2, 3 * f.ratio, [...theme.reach, 1]);
      one(slots.paint, ...theme.reach, reach.lines ? 0.4 : 0.45);
      gl.drawArrays(reach.lines ? gl.LINES : gl.POINTS, 0, reach.count);
    }
    for (const { goal, tip, colour } of marks.points) {
      gl.disable(gl.DEPTH_TEST);
      feed(slots.place, buffers.loose, new Float32Array([...tip, ...goal]));
      look(1); one(slots.paint, ...theme.ink, 0.7);
      gl.drawArrays(gl.LINES, 0, 2);
      look(2, 13 * f.ratio, [...theme.ground, 1]); one(slots.paint, ...theme.ink, 1);
      gl.drawArrays(gl.POINTS, 0, 1);
      look(3, 34 * f.ratio); one(slots.paint, ...colour, 1);
      gl.drawArrays(gl.POINTS, 1, 1);
      gl.enable(gl.DEPTH_TEST);
    }
    gl.depthMask(true);
  }

  // places: flat; lines: pairs of them, or else points.
  function setReach(places, lines) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.reach);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(places), gl.STATIC_DRAW);
    reach = { count: places.length / 3, lines };
  }

  return { draw, project, setReach, gl };
}
