// Numbers and the controller's status in words.
const short = (value, digits = 2) => {
  const text = Math.abs(value).toFixed(Math.abs(value) >= 1000 ? 0 : Math.abs(value) >= 100 ? Math.min(digits, 1) : digits);
  return value < 0 && Number(text) ? `−${text}` : text;
};
const length = mm => (mm < 0.01 ? "less than 0.01 mm" : `${short(mm)} mm`);

// Where an actuator stands at one of its limits, or "".
function limitOf(actuator, delta, lambda) {
  const near = (value, bound, scale) => bound !== null && Math.abs(value - bound) <= 1e-4 * scale;
  const cable = actuator.kind === "cable", stroke = actuator.delta[1] - actuator.delta[0];
  if (near(delta, actuator.delta[1], stroke)) return cable ? "pulled as far as it goes" : "filled as far as it goes";
  if (near(lambda, actuator.lambda[1], actuator.scale)) return cable ? "at its largest tension" : "at its largest pressure";
  if (near(lambda, actuator.lambda[0], actuator.scale)) return cable ? "slack" : actuator.lambda[0] === 0 ? "without pressure" : "at its smallest pressure";
  if (near(delta, actuator.delta[0], stroke)) return cable ? "let out as far as it goes" : "emptied as far as it goes";
  return "";
}

// [class, sentence] of where the robot is; missed: mm between goal and tip; moving: whether it still goes on.
function sentence(status, missed, moving, byHand, limits) {
  if (status & STATUS.BAD_INPUT) return ["bad", "That goal is no place. The robot stays where it is."];
  if (status & STATUS.NO_MODEL) return ["bad", "The model has no answer here. The robot stays where it is."];
  if (status & STATUS.NO_QP) return ["bad", "No command could be computed for this goal. The robot stays where it is."];
  if (byHand) return status & STATUS.NOT_FOUND ? ["warn", "The model knows no such state. The robot stays where it is."] : ["", "You set the actuators by hand."];
  if (status & STATUS.SOFTENED) return ["warn", "No force within its limits keeps the stroke: the command is the nearest that does."];
  if (moving) return ["", "Moving to the goal."];
  if (missed <= 0.01) return ["", "On the goal."];
  const held = limits.length ? ` (${limits.join("; ")})` : "";
  return ["warn", `The goal is out of reach: the tip is ${length(missed)} away${held}.`];
}

const aside = status => status & STATUS.OUTSIDE ? "Outside the range of the states that the model was trained on: it is less exact here." : status & STATUS.NOT_FOUND ? "The model found this state only approximately." : "";
