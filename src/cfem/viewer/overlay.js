// Over the picture: a bar of a round length, and which way x, y and z point.
const ARROW = 22; // pixels

function makeOverlay(canvas) {
  const box = document.createElement("div");
  box.className = "overlay";
  box.ariaHidden = "true";
  box.innerHTML = `<svg width="76" height="76" viewBox="-38 -38 76 76">${"<line></line><text></text>".repeat(3)}</svg><p><span></span><i></i></p>`;
  canvas.after(box);
  const bar = box.querySelector("i"), text = box.querySelector("span"), [lines, names] = ["line", "text"].map(tag => [...box.querySelectorAll(tag)]);
  const arrows = [..."xyz"].map((name, k) => { names[k].textContent = name; return [lines[k], names[k]]; });
  let last = "";
  // A round length that takes about a tenth of the view.
  const rounded = mm => {
    const power = 10 ** Math.floor(Math.log10(mm)), share = mm / power;
    return (share >= 5 ? 5 : share >= 2 ? 2 : 1) * power;
  };
  return camera => {
    const tall = canvas.clientHeight, key = [camera.azimuth, camera.elevation, camera.height, tall].join();
    if (key === last || !tall) return;
    last = key;
    const perPixel = camera.height / tall, mm = rounded(110 * perPixel), { right, up } = axesOf(camera);
    bar.style.width = `${mm / perPixel}px`;
    text.textContent = `${mm >= 1 ? mm : Number(mm.toPrecision(1))} mm`;
    arrows.forEach(([line, name], k) => {
      const x = ARROW * right[k], y = -ARROW * up[k];
      line.setAttribute("x2", x); line.setAttribute("y2", y);
      name.setAttribute("x", 1.42 * x); name.setAttribute("y", 1.42 * y + 4);
      name.style.opacity = line.style.opacity = Math.hypot(x, y) < 5 ? 0 : 1; // points at the reader
    });
  };
}
