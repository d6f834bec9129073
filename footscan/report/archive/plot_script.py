"""The script that draws points of an archive: plain JavaScript, without library."""

SCRIPT = """\
(() => {
  "use strict";
  const data = JSON.parse(document.getElementById("data").dataset.plot);
  const canvas = document.getElementById("plot"), under = document.getElementById("under");
  const [across, up, colour, uncertain] =
    ["across", "up", "colour", "uncertain"].map(id => document.getElementById(id));
  const key = document.getElementById("key"), names = Object.keys(data.columns), left = 150, bottom = 96, edge = 24;
  const hollow = Object.fromEntries(names.map(name => [name, new Set(data.untrusted[name])]));
  const palette = ["#1f6f8b", "#c2571a", "#3f7d3a", "#8a4f9e", "#a3283a", "#6b6b1d", "#4a5fb0", "#7a5a3a"];
  const opens = " (a click opens its report)";
  let points = [], nearest = null;

  function ticks(low, high) {
    const rough = (high - low) / 6 || 1, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map(k => k * power).find(k => k >= rough), found = [];
    for (let k = Math.ceil(low / step); k * step <= high + 1e-9; k++) found.push(+(k * step).toPrecision(12));
    return found;
  }

  function range(values) {
    const [low, high] = values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    const margin = (high - low) * 0.04 || Math.abs(low) * 0.05 || 1;
    return [low - margin, high + margin];
  }

  function correlation(pairs) {
    const n = pairs.length, mean = k => pairs.reduce((s, p) => s + p[k], 0) / n, mx = mean(0), my = mean(1);
    const sum = f => pairs.reduce((s, p) => s + f(p[0] - mx, p[1] - my), 0);
    const r = sum((x, y) => x * y) / Math.sqrt(sum((x, _) => x * x) * sum((_, y) => y * y));
    return Number.isFinite(r) ? r : null;
  }

  function draw() {
    canvas.width = canvas.clientWidth * 2;
    canvas.height = canvas.clientHeight * 2;
    const pen = canvas.getContext("2d"), [w, h] = [canvas.width, canvas.height];
    const xs = data.columns[across.value], ys = data.columns[up.value];
    const groups = colour.value ? data.groups[colour.value] : null;
    const kinds = groups ? [...new Set(groups)].sort() : [];
    const shown = xs.map((x, k) => [x, ys[k], k, hollow[across.value].has(k) || hollow[up.value].has(k)])
      .filter(([x, y, , isHollow]) => x !== null && y !== null && (uncertain.checked || !isHollow));
    pen.clearRect(0, 0, w, h);
    points = [];
    under.textContent = "No scan has both.";
    key.replaceChildren();
    if (!shown.length) return;
    const [x0, x1] = range(shown.map(p => p[0])), [y0, y1] = range(shown.map(p => p[1]));
    const toX = x => left + (x - x0) / (x1 - x0) * (w - left - edge);
    const toY = y => h - bottom - (y - y0) / (y1 - y0) * (h - bottom - edge);
    pen.font = "22px system-ui, sans-serif";
    pen.lineWidth = 2;
    pen.textAlign = "center";
    for (const x of ticks(x0, x1)) {
      pen.strokeStyle = "#dde2e7";
      pen.beginPath(); pen.moveTo(toX(x), edge); pen.lineTo(toX(x), h - bottom); pen.stroke();
      pen.fillStyle = "#5b6672";
      pen.fillText(String(x), toX(x), h - bottom + 30);
    }
    pen.textAlign = "right";
    for (const y of ticks(y0, y1)) {
      pen.beginPath(); pen.moveTo(left, toY(y)); pen.lineTo(w - edge, toY(y)); pen.stroke();
      pen.fillText(String(y), left - 12, toY(y) + 8);
    }
    pen.fillStyle = "#1c2530";
    pen.textAlign = "center";
    pen.fillText(across.value, (left + w) / 2, h - 18);
    pen.save();
    pen.translate(28, (h - bottom) / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(up.value, 0, 0);
    pen.restore();
    for (const [x, y, k, isHollow] of shown) {
      const at = [toX(x), toY(y)], hue = palette[groups ? kinds.indexOf(groups[k]) % palette.length : 0];
      points.push([...at, k]);
      pen.beginPath(); pen.arc(at[0], at[1], 7, 0, 2 * Math.PI);
      pen.fillStyle = pen.strokeStyle = hue;
      pen.globalAlpha = 0.75;
      if (isHollow) pen.stroke(); else pen.fill();
    }
    pen.globalAlpha = 1;
    if (nearest !== null) {
      const point = points.find(([, , k]) => k === nearest);
      if (point) {
        pen.strokeStyle = "#1c2530";
        pen.lineWidth = 4;
        pen.beginPath();
        pen.arc(point[0], point[1], 12, 0, 2 * Math.PI);
        pen.stroke();
      }
    }
    const trusted = shown.filter(p => !p[3]), r = trusted.length > 2 ? correlation(trusted) : null;
    const related = r === null ? "" : `; their correlation is ${r.toFixed(3)}`;
    under.textContent = nearest === null || !shown.some(p => p[2] === nearest)
      ? `${shown.length} scans, ${trusted.length} of them with both values ok${related}`
      : `${data.scans[nearest]}: ${xs[nearest]}, ${ys[nearest]}${data.reports[nearest] ? opens : ""}`;
    for (const [number, kind] of kinds.entries()) {
      const entry = document.createElement("span"), dot = document.createElement("i");
      dot.style.background = palette[number % palette.length];
      entry.append(dot, kind || "unknown");
      key.append(entry);
    }
  }

  function pointAt(event) {
    const box = canvas.getBoundingClientRect();
    const x = (event.clientX - box.left) * canvas.width / box.width;
    const y = (event.clientY - box.top) * canvas.height / box.height;
    let found = null, least = 30;
    for (const [px, py, k] of points) {
      const apart = Math.hypot(px - x, py - y);
      if (apart < least) [found, least] = [k, apart];
    }
    return found;
  }

  function choose(select, name) {
    if (names.includes(name)) select.value = name;
    select.addEventListener("change", () => { remember(); draw(); });
  }

  // The choice stands in the address, so that a link shows the same.
  function remember() {
    const chosen = {across: across.value, up: up.value, colour: colour.value};
    history.replaceState(null, "", "#" + new URLSearchParams(chosen));
  }

  const asked = new URLSearchParams(location.hash.slice(1));
  choose(across, asked.get("across") ?? names[0]);
  choose(up, asked.get("up") ?? names[Math.min(1, names.length - 1)]);
  if (asked.get("colour") in data.groups) colour.value = asked.get("colour");
  colour.addEventListener("change", () => { remember(); draw(); });
  uncertain.addEventListener("change", draw);
  canvas.addEventListener("pointermove", event => {
    const found = pointAt(event);
    canvas.style.cursor = found !== null && data.reports[found] ? "pointer" : "crosshair";
    if (found !== nearest) { nearest = found; draw(); }
  });
  canvas.addEventListener("click", event => {
    const found = pointAt(event);
    if (found !== null && data.reports[found]) window.open(data.reports[found], "_blank", "noopener");
  });
  window.addEventListener("resize", draw);
  draw();
})();
"""
