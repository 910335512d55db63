// The robot in WebAssembly: its controller, its model, the surface that its skin gives. Lengths in mm; forces in N or MPa.
const STATUS = { LIMITED: 1, SOFTENED: 2, OUTSIDE: 4, NOT_FOUND: 8, HELD: 16, BAD_INPUT: 32, NO_MODEL: 64, NO_QP: 128, OUT_OF_REACH: 1024, FAR: 2048 };

async function makeRobot({ said, arrays }) {
  if (typeof WebAssembly === "undefined") throw new Error("This page needs WebAssembly, which this browser lacks or has switched off, so nothing is drawn.");
  const { instance } = await WebAssembly.instantiate(arrays.code, {});
  const code = instance.exports, memory = code.memory;
  let free = code.__heap_base.value;
  const reserve = bytes => {
    const at = Math.ceil(free / 16) * 16;
    free = at + bytes;
    const short = free - memory.buffer.byteLength;
    if (short > 0) memory.grow(Math.ceil(short / 65536));
    return at;
  };
  const put = array => {
    const at = reserve(array.byteLength);
    new Uint8Array(memory.buffer, at, array.byteLength).set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
    return at;
  };
  const points = arrays.rest.length / 3, triangles = arrays.triangles.length / 3;
  const blockAt = put(arrays.block);
  if (code.load(blockAt, arrays.block.length)) throw new Error(CUT);
  code.surface(points, triangles, put(arrays.rest), put(arrays.modes), put(arrays.triangles));
  const movesAt = arrays.motion && put(arrays.motion);
  if (arrays.motion && code.motion_load(movesAt, arrays.motion.length)) throw new Error(CUT);
  const places = { x: reserve(24 * points), drawn: reserve(12 * points), normals: reserve(12 * points) };
  // No more memory from here on: views stay valid.
  const { room } = said, buffer = memory.buffer, n_a = said.actuators.length, n_e = said.rest_e.length;
  let at = code.io();
  const field = (size, used) => { const view = new Float64Array(buffer, at, used); at += 8 * size; return view; };
  const robot = {
    said, n_a, n_e, points, block: arrays.block, triangles: arrays.triangles,
    goal: field(room.effector, n_e), delta_a: field(room.actuator, n_a), lambda_a: field(room.actuator, n_a),
    x_e: field(room.effector, n_e), skin: field(room.skin, said.skin),
    states: arrays.states, x: new Float64Array(buffer, places.x, 3 * points), drawn: new Float32Array(buffer, places.drawn, 3 * points),
    normals: new Float32Array(buffer, places.normals, 3 * points),
    home: () => code.home(),
    tick: () => code.tick(),
    // Actuators by hand, lengths and volumes or (byForce) tensions and pressures; keep: the controller goes on from there.
    set: (values, byForce = false, keep = true) => {
      (byForce ? robot.lambda_a : robot.delta_a).set(values);
      return code.set(byForce ? 1 : 0, keep ? 1 : 0);
    },
    shape: () => { code.shape(places.x, places.drawn, places.normals); },
  };
  // The robot under a share of the largest weight, its actuators held. The share that it comes to: less where the model has no such state.
  let share = 0;
  const words = new Float64Array(buffer, blockAt, arrays.block.length / 8), bare = arrays.positions && Array.from(arrays.positions, at => words[at]);
  const loadWith = share => {
    const { positions, changes } = arrays, count = positions.length;
    for (let k = 0; k < count; k++) words[positions[k]] = bare[k] + share * (changes[k] + share * (changes[count + k] + share * changes[2 * count + k]));
    code.load(blockAt, arrays.block.length);
  };
  robot.weigh = wanted => {
    const byForce = said.command === "force", asked = [...(byForce ? robot.lambda_a : robot.delta_a)];
    const steps = Math.max(1, Math.ceil(Math.abs(wanted - share) / 0.02)), from = share;
    for (let k = 1; k <= steps; k++) {
      const next = from + k / steps * (wanted - from), before = [[...robot.delta_a], [...robot.lambda_a]];
      loadWith(next);
      const status = robot.set(asked, byForce);
      if (status & ~STATUS.OUTSIDE) {
        loadWith(share);
        robot.delta_a.set(before[0]); robot.lambda_a.set(before[1]);
        return share;
      }
      share = next;
    }
    return share;
  };
  if (arrays.motion) {
    const ahead = new Float64Array(buffer, code.motion_io(), room.effector * (room.ticks + 2) + 2 * room.actuator), rows = k => room.effector * k;
    robot.moves = {
      said: said.motion, curve: arrays.curve,
      start: () => code.motion_start(),
      // goals at the ends of the next ticks; shown: which robot is drawn
      tick: (goals, shown) => { goals.forEach((goal, k) => ahead.set(goal, rows(k))); return code.motion_tick(shown); },
      place: which => Array.from(ahead.subarray(rows(room.ticks + which), rows(room.ticks + which) + n_e)),
      command: which => Array.from(ahead.subarray(rows(room.ticks + 2) + which * room.actuator, rows(room.ticks + 2) + which * room.actuator + n_a)),
    };
  }
  robot.home();
  return robot;
}
