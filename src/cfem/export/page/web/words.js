// Numbers and the controller's status in words.
const short = (value, digits = 2) => {
  const text = Math.abs(value).toFixed(Math.abs(value) >= 1000 ? 0 : Math.abs(value) >= 100 ? Math.min(digits, 1) : digits);
  return value < 0 && Number(text) ? `−${text}` : text;
};
const length = mm => (mm < 0.01 ? "less than 0.01 mm" : `${short(mm)} mm`);
const weightOf = newtons => { const grams = newtons / 9.80665e-3; return `${short(grams, grams < 10 ? 2 : 1)} g · ${newtons < 0.1 ? `${short(1000 * newtons, 1)} mN` : `${short(newtons)} N`}`; };
const list = names => (names.length < 2 ? names.join("") : `${names.slice(0, -1).join(", ")} and ${names.at(-1)}`);

// By the kind of an actuator: the title of its colours, what it is at the ends of its stroke, and what its multiplier is.
const KINDS = {
  cable: { title: "Tension of the cables", taken: "pulled", given: "let out", force: "tension" },
  push: { title: "Force of the pushes", taken: "pushed", given: "drawn back", force: "force" },
  chamber: { title: "Pressure in the chambers", taken: "filled", given: "emptied", force: "pressure" },
};

// Where an actuator stands at one of its limits, or "".
function limitOf(actuator, delta, lambda) {
  const near = (value, bound, scale, within = 1e-4) => bound !== null && Math.abs(value - bound) <= within * scale;
  const { taken, given, force } = KINDS[actuator.kind], stroke = actuator.delta[1] - actuator.delta[0];
  if (near(delta, actuator.delta[1], stroke)) return `${taken} as far as it goes`;
  if (near(lambda, actuator.lambda[1], actuator.scale)) return `at its largest ${force}`;
  if (near(lambda, actuator.lambda[0], actuator.scale, 2e-3)) return actuator.kind === "cable" ? "slack" : actuator.lambda[0] === 0 ? `without ${force}` : `at its smallest ${force}`;
  if (near(delta, actuator.delta[0], stroke)) return `${given} as far as it goes`;
  return "";
}

// Actuators that hold the robot back, [name, limit] each: those at the same limit together.
function heldBy(limits) {
  const together = new Map();
  for (const [name, limit] of limits) together.set(limit, [...(together.get(limit) ?? []), name]);
  const plural = (limit, names) => (names.length < 2 ? limit : limit.replace("at its largest", "at their largest").replace("at its smallest", "at their smallest").replace("as it goes", "as they go"));
  return [...together].map(([limit, names]) => `${list(names)} ${names.length > 1 ? "are" : "is"} ${plural(limit, names)}`).join("; ");
}

// [class, sentence] of where the robot is; missed: mm between goal and tip; moving: whether it still goes on; limits: see heldBy;
// actuators: how many there are; runs: whether its goal runs round a curve.
function sentence(status, missed, moving, byHand, limits, actuators, runs) {
  if (runs) return ["", "Following a goal that moves. Drag it, or set the speed to 0, to stop."];
  if (status & STATUS.FAR) return ["bad", "That goal is farther away than twice the robot's length. The robot stays where it is."];
  if (status & STATUS.BAD_INPUT) return ["bad", "That goal is no place. The robot stays where it is."];
  if (status & STATUS.NO_MODEL) return ["bad", "The model has no answer here. The robot stays where it is."];
  if (status & STATUS.NO_QP) return ["bad", "No command could be computed for this goal. The robot stays where it is."];
  if (byHand) return status & STATUS.NOT_FOUND ? ["warn", "The model knows no such state. The robot stays where it is."] : ["", "You set the actuators by hand."];
  if (status & STATUS.SOFTENED) return ["warn", "No force within its limits keeps the stroke: the command is the nearest that does."];
  if (moving) return ["", "Moving to the goal."];
  if (missed <= 0.01) return ["", "On the goal."];
  const how = `the tip is ${length(missed)} away`;
  if (!(status & STATUS.OUT_OF_REACH)) return ["warn", `The search ended before the nearest point to the goal: ${how}.`];
  if (limits.length) return ["warn", `The goal is out of reach: ${how} (${heldBy(limits)}).`];
  const lies = { 1: "beside the line that one actuator reaches", 2: "beside the surface that two actuators reach" }[actuators];
  return ["warn", lies ? `The goal lies ${lies}: ${how}.` : `The goal is out of reach: ${how}.`];
}

const aside = status => status & STATUS.OUTSIDE ? "Outside the range of the states that the model was trained on: it is less exact here." : status & STATUS.NOT_FOUND ? "The model found this state only approximately." : "";
