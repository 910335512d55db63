// Pointer and keys: the goal is dragged in the plane of the screen through it; elsewhere the view turns; two fingers or the wheel
// zoom.
const GRASP = { mouse: 26, pen: 30, touch: 44 }; // pixels around goal or tip

function pointers(canvas, scene, state, goals, moveGoal, again) {
  const held = new Map();
  let last = null;
  const at = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  const grasped = (event, [x, y]) => {
    let best = null, nearest = GRASP[event.pointerType] ?? 30;
    for (const one of goals) for (const [place, bonus] of [[one.place, 0], [one.tip, 6]]) {
      const [u, v] = scene.project(state.camera, place), apart = Math.hypot(u - x, v - y) + bonus;
      if (apart < nearest) { nearest = apart; best = one; }
    }
    return best;
  };
  const perPixel = () => state.camera.height / canvas.clientHeight;
  const zoom = factor => { state.camera.height = Math.min(Math.max(state.camera.height * factor, 0.02 * state.camera.size), 20 * state.camera.size); again(); };
  canvas.onpointerdown = event => {
    held.set(event.pointerId, at(event));
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
    canvas.classList.add("touched"); // no ring of focus for a pointer
    if (held.size > 1) { state.dragged = null; last = null; return; }
    state.dragged = event.button === 0 ? grasped(event, at(event)) : null;
    last = at(event);
    if (state.dragged) {
      // What is grasped follows the pointer from where it is: the goal begins at the tip where that was taken.
      const one = state.dragged, near = place => { const [u, v] = scene.project(state.camera, place); return Math.hypot(u - last[0], v - last[1]); };
      if (near(one.tip) + 6 < near(one.place)) moveGoal(one, one.tip);
    }
    canvas.classList.toggle("holding", !state.dragged);
    again();
  };
  canvas.onpointermove = event => {
    const here = at(event);
    if (!held.has(event.pointerId)) { canvas.classList.toggle("over", Boolean(grasped(event, here))); return; }
    const before = held.get(event.pointerId), [dx, dy] = [here[0] - before[0], here[1] - before[1]];
    if (held.size === 2) {
      const other = [...held].find(([id]) => id !== event.pointerId)[1], apart = p => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      zoom(apart(before) / apart(here));
      pan(dx / 2, dy / 2);
    } else if (state.dragged) {
      const { right, up } = axesOf(state.camera), s = perPixel();
      moveGoal(state.dragged, add(add(state.dragged.place, right, s * dx), up, -s * dy));
    } else if (event.buttons & 2 || event.shiftKey) pan(dx, dy);
    else {
      state.camera.azimuth -= 0.45 * dx;
      state.camera.elevation = Math.min(Math.max(state.camera.elevation + 0.4 * dy, -89), 89);
    }
    held.set(event.pointerId, here);
    again();
  };
  function pan(dx, dy) {
    const { right, up } = axesOf(state.camera), s = perPixel();
    state.camera.centre = add(add(state.camera.centre, right, -s * dx), up, s * dy);
  }
  canvas.onpointerup = canvas.onpointercancel = event => {
    held.delete(event.pointerId);
    if (!held.size) { state.dragged = null; canvas.classList.remove("holding"); }
  };
  canvas.oncontextmenu = event => event.preventDefault();
  canvas.addEventListener("wheel", event => { event.preventDefault(); zoom(Math.exp(0.0012 * event.deltaY * (event.deltaMode ? 30 : 1))); }, { passive: false });
}

// Arrows move the goal in the plane of the screen, Page Up and Down towards the reader and away; with shift the arrows turn the view.
function keys(canvas, state, goals, moveGoal, again) {
  canvas.onkeydown = event => {
    canvas.classList.remove("touched");
    const ways = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1] };
    const way = ways[event.key], camera = state.camera;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (way && event.shiftKey) {
      camera.azimuth += 4 * way[0];
      camera.elevation = Math.min(Math.max(camera.elevation + 4 * way[1], -89), 89);
    } else if (way) {
      const { right, up, towards } = axesOf(camera), one = goals[state.chosen ?? 0], step = 0.01 * camera.size;
      moveGoal(one, add(add(add(one.place, right, step * way[0]), up, step * way[1]), towards, step * way[2]));
    } else if (event.key === "+" || event.key === "=") camera.height /= 1.15;
    else if (event.key === "-") camera.height *= 1.15;
    else if (event.key === "Home") document.getElementById("home").click();
    else if (event.key === "Enter" && goals.length > 1) state.chosen = ((state.chosen ?? 0) + 1) % goals.length;
    else return;
    event.preventDefault();
    again();
  };
}
