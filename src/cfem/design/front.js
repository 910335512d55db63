// The front as points to click; the player shows the design that is chosen.
(() => {
  "use strict";
  const data = JSON.parse(document.getElementById("data").textContent);
  const svg = document.getElementById("front"), names = data.objectives, count = data.designs.length;
  const box = { left: 62, right: 440, top: 16, bottom: 330 }, axes = [0, 1];
  let chosen = 0;
  const make = (tag, attributes, text) => {
    const one = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
    if (text !== undefined) one.textContent = text;
    svg.append(one);
    return one;
  };
  const short = value => Number(value.toPrecision(4)).toString();
  const ends = k => { const all = data.values.map(row => row[k]), low = Math.min(...all), high = Math.max(...all), pad = 0.06 * (high - low || 1); return [low - pad, high + pad]; };
  const place = (value, [low, high], a, b) => a + (b - a) * (value - low) / (high - low);

  const ticks = ([low, high]) => {  // round numbers: steps of 1, 2 or 5 times a power of ten
    const rough = (high - low) / 5, ten = 10 ** Math.floor(Math.log10(rough)), step = ten * [1, 2, 5, 10].find(k => k * ten >= rough);
    const first = Math.ceil(low / step);
    return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
  };

  function plot() {
    svg.replaceChildren();
    const [x, y] = axes.map(ends), third = names.findIndex((_, k) => !axes.includes(k));
    make("line", { x1: box.left, y1: box.bottom, x2: box.right, y2: box.bottom });
    make("line", { x1: box.left, y1: box.bottom, x2: box.left, y2: box.top });
    for (const u of ticks(x)) make("text", { x: place(u, x, box.left, box.right), y: box.bottom + 17, "text-anchor": "middle" }, short(u));
    for (const v of ticks(y)) make("text", { x: box.left - 6, y: place(v, y, box.bottom, box.top) + 4, "text-anchor": "end" }, short(v));
    make("text", { x: (box.left + box.right) / 2, y: 370, "text-anchor": "middle" }, "← " + names[axes[0]] + (third < 0 ? "" : `  (size: ${names[third]})`));
    make("text", { x: box.left + 6, y: box.top + 4 }, "↓ " + names[axes[1]]);
    data.values.forEach((row, i) => {
      const r = third < 0 ? 6 : 4 + 7 * place(row[third], ends(third), 0, 1);
      const dot = make("circle", {
        cx: place(row[axes[0]], x, box.left, box.right), cy: place(row[axes[1]], y, box.bottom, box.top), r,
        fill: "var(--c0)", class: i === chosen ? "chosen" : "", tabindex: 0, role: "button", "aria-label": `design ${i + 1}`,
      });
      dot.addEventListener("click", () => choose(i));
      dot.addEventListener("keydown", event => { if (event.key === "Enter") choose(i); });
    });
  }

  // Names are what users wrote: they become text, never HTML.
  const tag = (name, content = "", className = "") => {
    const one = document.createElement(name);
    one.className = className;
    one.append(...[content].flat());
    return one;
  };
  const bar = share => {
    const filled = tag("i");
    filled.style.width = `${(100 * Math.min(Math.max(share, 0), 1)).toFixed(1)}%`;
    return tag("span", filled, "bar");
  };
  const bars = rows => tag("div", rows.flatMap(([name, share, said]) => [tag("span", name), bar(share), tag("span", said)]), "bars");

  function choose(i) {
    chosen = (i + count) % count;
    const select = document.querySelector(".viewer select");
    if (select) { select.value = chosen; select.dispatchEvent(new Event("change")); }
    plot();
    const rows = data.parameters.map((one, k) => [one.name, data.shares[chosen][k], `${short(data.designs[chosen][k])} ${one.unit}`]);
    const found = names.map((name, k) => `${name} ${short(data.values[chosen][k])}`).join(", ");
    document.getElementById("design").replaceChildren(tag("h2", `Design ${chosen + 1}`), tag("p", found), bars(rows));
  }

  const picker = document.getElementById("axes");
  if (names.length > 2) {
    ["across", "up"].forEach((label, d) => {
      const select = document.createElement("select");
      names.forEach((name, k) => select.add(new Option(name, k, false, k === axes[d])));
      select.onchange = () => { axes[d] = Number(select.value); plot(); };
      picker.append(tag("label", [label + " ", select]));
    });
  }
  const matters = Object.entries(data.matters);
  const largest = shares => Object.entries(shares).sort((a, b) => b[1] - a[1]).filter(one => one[1] > 0.005).map(([key, share]) => [key, share, `${(100 * share).toFixed(0)} %`]);
  if (matters.length)
    document.getElementById("matters").replaceChildren(
      tag("h2", "Which parameter matters"), tag("p", "Share of the variance over all designs."),
      ...matters.flatMap(([name, shares]) => [tag("h3", name), bars(largest(shares))]),
    );
  addEventListener("keydown", event => { if (event.target.tagName !== "SELECT" && event.target.tagName !== "INPUT") { if (event.key === "ArrowRight") choose(chosen + 1); if (event.key === "ArrowLeft") choose(chosen - 1); } });
  choose(0);
})();
