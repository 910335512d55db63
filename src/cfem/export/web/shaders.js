// What the graphics card runs: one program for surfaces, one for lines and marks. Only the second throws pixels away: a card tests
// depth before it computes a surface's colour, which halves what a picture costs where the processor draws it.
const SURFACE = {
  vertex: `
attribute vec3 place, normal;
uniform mat4 view; uniform mat3 turn;
varying vec3 facing;
void main() { gl_Position = view * vec4(place, 1.0); facing = turn * normal; }`,
  fragment: `
precision mediump float;
varying vec3 facing;
uniform vec4 paint, rim;
void main() {
  vec3 n = normalize(facing);
  float lit = 0.62 + 0.30 * max(dot(n, vec3(-0.342, 0.587, 0.734)), 0.0) + 0.12 * n.y;
  float edge = 1.0 - abs(n.z);
  edge *= edge * (0.3 + 0.7 * edge);
  gl_FragColor = vec4(mix(paint.rgb * lit, rim.rgb, edge * rim.a), paint.a + edge * (1.0 - paint.a) * 0.6);
}`,
  uniforms: ["view", "turn", "paint", "rim"],
};
const PLAIN = 0, DISC = 1, TARGET = 2;
const MARK = {
  vertex: `
attribute vec3 place;
uniform mat4 view; uniform float size;
void main() { gl_Position = view * vec4(place, 1.0); gl_PointSize = size; }`,
  fragment: `
precision mediump float;
uniform int kind; uniform vec4 paint, rim;
void main() {
  vec4 c = paint;
  if (kind == ${DISC}) {
    float r = 2.0 * length(gl_PointCoord - 0.5);
    if (r > 1.0) discard;
    c = r > 0.72 ? vec4(rim.rgb, c.a * smoothstep(1.0, 0.94, r)) : c;
  } else if (kind == ${TARGET}) {
    float r = 2.0 * length(gl_PointCoord - 0.5), across = min(abs(gl_PointCoord.x - 0.5), abs(gl_PointCoord.y - 0.5));
    float ring = smoothstep(0.62, 0.68, r) * smoothstep(1.0, 0.94, r);
    float cross = step(across, 0.035) * step(r, 0.9);
    c.a *= max(ring, cross);
    if (c.a < 0.02) discard;
  }
  gl_FragColor = c;
}`,
  uniforms: ["view", "size", "kind", "paint", "rim"],
};

// A program with its uniforms by name; `place` and `normal` are attributes 0 and 1.
function makeProgram(gl, { vertex, fragment, uniforms }) {
  const compile = (type, text) => {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text); gl.compileShader(shader);
    return shader;
  };
  const program = gl.createProgram();
  gl.attachShader(program, compile(gl.VERTEX_SHADER, vertex));
  gl.attachShader(program, compile(gl.FRAGMENT_SHADER, fragment));
  gl.bindAttribLocation(program, 0, "place"); gl.bindAttribLocation(program, 1, "normal");
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error("This browser's WebGL cannot run this page, so nothing is drawn.");
  return { program, ...Object.fromEntries(uniforms.map(name => [name, gl.getUniformLocation(program, name)])) };
}

// Whether WebGL has no graphics card here: smooth edges then cost twice the time.
function inSoftware() {
  const gl = document.createElement("canvas").getContext("webgl"), known = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = known ? gl.getParameter(known.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}
