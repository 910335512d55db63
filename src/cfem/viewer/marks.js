// What is drawn over a picture: lines, discs, targets. `screen` takes a place to its pixels.
const css = (rgb, alpha = 1) => `rgb(${rgb.map(value => Math.round(255 * value)).join(" ")} / ${alpha})`;

// Lines between pairs of places (flat); those whose ends `skip` names are left out.
function strokes(brush, screen, places, style, width, skip = () => false) {
  brush.strokeStyle = style; brush.lineWidth = width;
  brush.beginPath();
  for (let i = 0; i + 5 < places.length; i += 6) {
    const p = [places[i], places[i + 1], places[i + 2]], q = [places[i + 3], places[i + 4], places[i + 5]];
    if (skip(p, q)) continue;
    const [x, y] = screen(p), [u, v] = screen(q);
    brush.moveTo(x, y); brush.lineTo(u, v);
  }
  brush.stroke();
}

function path(brush, screen, places, style, width) {
  brush.strokeStyle = style; brush.lineWidth = width;
  brush.beginPath();
  places.map(screen).forEach(([x, y], i) => i ? brush.lineTo(x, y) : brush.moveTo(x, y));
  brush.stroke();
}

function disc(brush, screen, place, radius, style, edge, width) {
  const [x, y] = screen(place);
  brush.beginPath(); brush.arc(x, y, radius, 0, 2 * Math.PI);
  brush.fillStyle = style; brush.fill();
  brush.strokeStyle = edge; brush.lineWidth = width; brush.stroke();
}

// Small discs of one colour at places (flat).
function dots(brush, screen, places, style, radius, skip) {
  brush.fillStyle = style;
  brush.beginPath();
  for (let i = 0; i < places.length; i += 3) {
    const p = [places[i], places[i + 1], places[i + 2]];
    if (skip(p)) continue;
    const [x, y] = screen(p);
    brush.moveTo(x + radius, y); brush.arc(x, y, radius, 0, 2 * Math.PI);
  }
  brush.fill();
}

// A ring with a cross.
function target(brush, screen, place, style) {
  const [x, y] = screen(place);
  brush.strokeStyle = style; brush.lineWidth = 4;
  brush.beginPath(); brush.arc(x, y, 14, 0, 2 * Math.PI); brush.stroke();
  brush.lineWidth = 2;
  brush.beginPath();
  brush.moveTo(x - 14, y); brush.lineTo(x + 14, y); brush.moveTo(x, y - 14); brush.lineTo(x, y + 14);
  brush.stroke();
}
