"""The script that turns the canvas of a page: plain JavaScript, without library or graphics card."""

SCRIPT = """\
(() => {
  "use strict";
  const canvas = document.getElementById("canvas"), zoom = document.getElementById("zoom");
  const data = canvas.dataset, said = document.getElementById("shown"), marks = document.getElementById("landmarks");
  const buffer = name => Uint8Array.from(atob(data[name]), c => c.charCodeAt(0)).buffer;
  const points = new Int16Array(buffer("points")), faces = new Uint16Array(buffer("faces"));
  const all = new Uint8Array(buffer("colours")), drawings = JSON.parse(data.drawings);
  const places = JSON.parse(data.landmarks), near = 28;
  const light = [-0.35, 0.5, 0.79], inside = 0.45, most = Math.PI / 2, start = [-0.7, 0.5];
  const views = {above: [0, most], below: [0, -most], left: [Math.PI, 0], right: [0, 0],
    front: [-most, 0], back: [most, 0]};
  const count = points.length / 3;
  const normals = vertexNormals();
  const seen = new Float32Array(count * 3), outer = new Float32Array(count), inner = new Float32Array(count);
  const towards = new Float32Array(count), fingers = new Map();
  let held = null, pressed = null;
  let [turn, tilt] = start, colours = all.subarray(0, count * 3), shown = null, pixels, depth, scale, waiting = false;

  function vertexNormals() {
    const sums = new Float32Array(count * 3);
    for (let f = 0; f < faces.length; f += 3) {
      const [a, b, c] = [faces[f] * 3, faces[f + 1] * 3, faces[f + 2] * 3];
      const u = [0, 1, 2].map(k => points[b + k] - points[a + k]);
      const v = [0, 1, 2].map(k => points[c + k] - points[a + k]);
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (const corner of [a, b, c]) for (let k = 0; k < 3; k++) sums[corner + k] += n[k];
    }
    for (let p = 0; p < sums.length; p += 3) {
      const length = Math.hypot(sums[p], sums[p + 1], sums[p + 2]) || 1;
      for (let k = 0; k < 3; k++) sums[p + k] /= length;
    }
    return sums;
  }

  // Turned about Z, then tilted towards the viewer: right, up and towards the viewer.
  function rotation() {
    const [c, s, ct, st] = [Math.cos(turn), Math.sin(turn), Math.cos(tilt), Math.sin(tilt)];
    return [c, -s, 0, s * st, c * st, ct, -s * ct, -c * ct, st];
  }

  function project(m, x, y, z) {
    const s = scale * zoom.value;
    return [canvas.width / 2 + s * (m[0] * x + m[1] * y + m[2] * z),
      canvas.height / 2 - s * (m[3] * x + m[4] * y + m[5] * z), m[6] * x + m[7] * y + m[8] * z];
  }

  function fit() {
    // Twice the size that is shown: the browser smooths the outlines.
    canvas.width = Math.max(1, canvas.clientWidth * 2);
    canvas.height = Math.max(1, canvas.clientHeight * 2);
    pixels = new ImageData(canvas.width, canvas.height);
    depth = new Float32Array(canvas.width * canvas.height);
    scale = Math.min(canvas.width, canvas.height * 1.25) / 65534;
    draw();
  }

  function draw() {
    waiting = false;
    const m = rotation(), w = canvas.width, h = canvas.height, s = scale * zoom.value;
    for (let p = 0; p < count; p++) {
      const [x, y, z] = [points[p * 3], points[p * 3 + 1], points[p * 3 + 2]];
      seen[p * 3] = w / 2 + s * (m[0] * x + m[1] * y + m[2] * z);
      seen[p * 3 + 1] = h / 2 - s * (m[3] * x + m[4] * y + m[5] * z);
      seen[p * 3 + 2] = m[6] * x + m[7] * y + m[8] * z;
      const [u, v, n] = [normals[p * 3], normals[p * 3 + 1], normals[p * 3 + 2]];
      towards[p] = m[6] * u + m[7] * v + m[8] * n;
      const right = m[0] * u + m[1] * v + m[2] * n, up = m[3] * u + m[4] * v + m[5] * n;
      const lit = right * light[0] + up * light[1] + towards[p] * light[2];
      outer[p] = 0.30 + 0.24 * Math.max(0, towards[p]) + 0.46 * Math.max(0, lit);
      inner[p] = inside * (0.30 + 0.24 * Math.max(0, -towards[p]) + 0.46 * Math.max(0, -lit));
    }
    pixels.data.fill(0);
    depth.fill(-Infinity);
    for (let f = 0; f < faces.length; f += 3) fill(faces[f], faces[f + 1], faces[f + 2], w, h);
    const pen = canvas.getContext("2d");
    pen.putImageData(pixels, 0, 0);
    drawOver(pen, m);
  }

  // One triangle, the nearest at each pixel winning.
  function fill(a, b, c, w, h) {
    const xa = seen[a * 3], ya = seen[a * 3 + 1], za = seen[a * 3 + 2];
    const xb = seen[b * 3] - xa, yb = seen[b * 3 + 1] - ya, zb = seen[b * 3 + 2] - za;
    const xc = seen[c * 3] - xa, yc = seen[c * 3 + 1] - ya, zc = seen[c * 3 + 2] - za;
    const area = xb * yc - xc * yb;
    if (area === 0) return;
    // By the normals, since simplifying may turn a sliver over: inside is what clearly looks away from the viewer.
    const shade = towards[a] + towards[b] + towards[c] > -0.6 ? outer : inner;
    const left = Math.max(0, Math.ceil(xa + Math.min(0, xb, xc))), right = Math.min(w - 1, xa + Math.max(0, xb, xc));
    const top = Math.max(0, Math.ceil(ya + Math.min(0, yb, yc))), bottom = Math.min(h - 1, ya + Math.max(0, yb, yc));
    for (let row = top; row <= bottom; row++) for (let column = left; column <= right; column++) {
      const x = column - xa, y = row - ya;
      const atB = (x * yc - xc * y) / area, atC = (xb * y - x * yb) / area, atA = 1 - atB - atC;
      if (atA < 0 || atB < 0 || atC < 0) continue;
      const z = za + atB * zb + atC * zc, pixel = row * w + column;
      if (z <= depth[pixel]) continue;
      depth[pixel] = z;
      const lit = atA * shade[a] + atB * shade[b] + atC * shade[c];
      for (let k = 0; k < 3; k++) {
        const colour = atA * colours[a * 3 + k] + atB * colours[b * 3 + k] + atC * colours[c * 3 + k];
        pixels.data[pixel * 4 + k] = lit * colour;
      }
      pixels.data[pixel * 4 + 3] = 255;
    }
  }

  // Whether the surface hides a place; what lies 2 % of the foot's half size below it is still seen.
  function hidden([x, y, z]) {
    const [column, row] = [Math.round(x), Math.round(y)];
    if (column < 0 || row < 0 || column >= canvas.width || row >= canvas.height) return false;
    return depth[row * canvas.width + column] > z + 650;
  }

  // The section of a measure, and landmarks: pale where they are on the far side.
  function drawOver(pen, m) {
    const drawing = shown === null ? {lines: [], points: []} : drawings[shown];
    pen.lineCap = "round";
    for (const line of drawing.lines) for (const near of [false, true]) for (let k = 0; k + 5 < line.length; k += 3) {
      const from = project(m, line[k], line[k + 1], line[k + 2]);
      const to = project(m, line[k + 3], line[k + 4], line[k + 5]);
      if ((hidden(from) && hidden(to)) === near) continue;
      pen.strokeStyle = near ? "#b3202c" : "#b3202c55";
      pen.lineWidth = near ? 6 : 4;
      pen.beginPath();
      pen.moveTo(from[0], from[1]);
      pen.lineTo(to[0], to[1]);
      pen.stroke();
    }
    const named = marks !== null && marks.checked ? Object.entries(places) : [];
    for (const [name, place] of [...named, ...drawing.points.map(point => ["", point])]) {
      const at = project(m, ...place), far = hidden(at);
      pen.globalAlpha = far ? 0.35 : 1;
      pen.fillStyle = "#b3202c";
      pen.strokeStyle = "#fff";
      pen.lineWidth = 3;
      pen.beginPath();
      pen.arc(at[0], at[1], 8, 0, 2 * Math.PI);
      pen.fill();
      pen.stroke();
      if (far || name === "") continue;
      pen.font = "22px system-ui, sans-serif";
      const wide = pen.measureText(name).width + 14;
      const left = at[0] + wide > canvas.width ? at[0] - wide : at[0] + 14;
      pen.lineWidth = 5;
      pen.strokeStyle = "#ffffffd0";
      pen.strokeText(name, left, at[1] + 7);
      pen.fillStyle = "#1c2530";
      pen.fillText(name, left, at[1] + 7);
    }
    pen.globalAlpha = 1;
  }

  function inCanvas(event) {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) * canvas.width / box.width,
      (event.clientY - box.top) * canvas.height / box.height];
  }

  // The place of the surface under a pointer; null beside it. A rotation's inverse is its transpose.
  function surfaceAt(event) {
    const [x, y] = inCanvas(event).map(Math.round), m = rotation(), s = scale * zoom.value;
    if (x < 0 || y < 0 || x >= canvas.width || y >= canvas.height) return null;
    const [right, up, towards] = [(x - canvas.width / 2) / s, (canvas.height / 2 - y) / s, depth[y * canvas.width + x]];
    if (towards === -Infinity) return null;
    return [0, 1, 2].map(k => Math.round(m[k] * right + m[3 + k] * up + m[6 + k] * towards));
  }

  // A page with `data-movable` moves landmarks: by dragging one, or by a click for the one in `data-armed`.
  function landmarkAt(event) {
    if (data.movable === undefined) return null;
    const m = rotation(), [x, y] = inCanvas(event);
    const found = Object.entries(places).map(([name, place]) => [name, project(m, ...place)])
      .filter(([, at]) => !hidden(at)).map(([name, at]) => [name, Math.hypot(at[0] - x, at[1] - y)])
      .filter(([, apart]) => apart < near).sort((a, b) => a[1] - b[1]);
    return found.length ? found[0][0] : null;
  }

  function moved(name) {
    canvas.dispatchEvent(new CustomEvent("landmark", {detail: {name, place: places[name]}}));
  }

  function redraw() {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  }

  function turnBy(right, down) {
    turn += right;
    tilt = Math.max(-most, Math.min(most, tilt + down));
    redraw();
  }

  function zoomBy(factor) {
    zoom.value = Math.max(zoom.min, Math.min(zoom.max, zoom.value * factor));
    redraw();
  }

  function show(button) {
    const again = button.dataset.shows === shown;
    shown = again ? null : button.dataset.shows;
    for (const other of document.querySelectorAll("[data-shows]"))
      other.setAttribute("aria-pressed", String(other === button && !again));
    said.textContent = again ? "" : button.dataset.told;
    redraw();
  }

  canvas.addEventListener("pointerdown", event => {
    canvas.setPointerCapture(event.pointerId);
    pressed = [event.clientX, event.clientY];
    held = landmarkAt(event);
    if (held !== null) return;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointerup", event => {
    const stood = pressed !== null && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4;
    const place = stood && data.armed ? surfaceAt(event) : null;
    if (place !== null) { places[data.armed] = place; moved(data.armed); redraw(); }
    else if (held !== null && !stood) moved(held);
  });
  canvas.addEventListener("place", event => {
    if (event.detail.place === null) delete places[event.detail.name];
    else places[event.detail.name] = event.detail.place;
    redraw();
  });
  for (const end of ["pointerup", "pointercancel"])
    canvas.addEventListener(end, event => { fingers.delete(event.pointerId); held = pressed = null; });
  canvas.addEventListener("pointermove", event => {
    if (held !== null) {
      const place = surfaceAt(event);
      if (place !== null) { places[held] = place; redraw(); }
      return;
    }
    const before = fingers.get(event.pointerId);
    if (before === undefined) return;
    const other = [...fingers].find(([id]) => id !== event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (other === undefined) {
      turnBy((event.clientX - before[0]) * 0.01, (event.clientY - before[1]) * 0.01);
    } else {
      const apart = ([x, y]) => Math.hypot(x - other[1][0], y - other[1][1]) || 1;
      zoomBy(apart([event.clientX, event.clientY]) / apart(before));
    }
  });
  canvas.addEventListener("keydown", event => {
    const keys = {ArrowLeft: () => turnBy(-0.1, 0), ArrowRight: () => turnBy(0.1, 0), ArrowUp: () => turnBy(0, -0.1),
      ArrowDown: () => turnBy(0, 0.1), "+": () => zoomBy(1.1), "-": () => zoomBy(1 / 1.1),
      Home: () => { [turn, tilt] = start; zoom.value = 1; redraw(); }};
    if (!(event.key in keys)) return;
    event.preventDefault();
    keys[event.key]();
  });
  document.addEventListener("click", event => {
    const row = event.target.closest("tr"), button = row && row.querySelector("[data-shows]");
    if (button) show(button);
    const view = event.target.closest("[data-view]");
    if (view) { [turn, tilt] = views[view.dataset.view]; redraw(); }
  });
  for (const choice of document.querySelectorAll("input[name=colouring]"))
    choice.addEventListener("change", () => {
      colours = all.subarray(choice.value * count * 3, (Number(choice.value) + 1) * count * 3);
      for (const meaning of document.querySelectorAll("[data-meaning]"))
        meaning.hidden = meaning.dataset.meaning !== choice.value;
      redraw();
    });
  zoom.addEventListener("input", redraw);
  if (marks !== null) marks.addEventListener("change", redraw);
  window.addEventListener("resize", fit);
  document.getElementById("viewer").hidden = false;
  fit();
})();
"""
