"""The surface in 3D, to be turned by hand: a small mesh on the page and a few lines of JavaScript, no library."""

import base64
import hashlib

import numpy as np
from numpy.typing import NDArray

from footscan.surface.decimate import decimate
from footscan.surface.mesh import Mesh, used

_MOST_TRIANGLES = 12_000
"""They have no more than 36,000 corners, so 16 bits number them; some 150 kB on the page."""


def viewer(vertices: NDArray[np.float64], faces: NDArray[np.integer], colours: NDArray[np.uint8]) -> str:
    """A canvas that shows the surface once `SCRIPT` has run, and is not seen without it.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, foot's frame, Z up
    faces : (F, 3) int, counter-clockwise as seen from outside
    colours : (V, 3) uint8, RGB
    """
    small = decimate(used(Mesh(vertices, np.asarray(faces, np.int32), colours=colours)), _MOST_TRIANGLES)
    points = small.vertices - (small.vertices.min(axis=0) + small.vertices.max(axis=0)) / 2
    radius = max(float(np.linalg.norm(points, axis=1).max()), np.finfo(np.float64).tiny)
    arrays = {
        "points": np.rint(points / radius * 32767).astype("<i2"),
        # Of a surface in thousands of shreds, which has no smaller form, what 16 bits cannot number is not shown.
        "faces": small.faces[(small.faces < 2**16).all(axis=1)].astype("<u2"),
        "colours": small.colours,
    }
    data = " ".join(f'data-{name}="{base64.b64encode(array.tobytes()).decode()}"' for name, array in arrays.items())
    return (
        '<figure id="viewer" hidden><figcaption>In 3D <span>drag to turn</span>'
        '<input id="zoom" type="range" min="0.8" max="4" step="0.05" value="1" aria-label="Size"></figcaption>'
        f'<canvas id="canvas" role="img" aria-label="The surface in 3D" {data}></canvas></figure>'
    )


SCRIPT = """\
(() => {
  "use strict";
  const canvas = document.getElementById("canvas"), zoom = document.getElementById("zoom");
  const buffer = name => Uint8Array.from(atob(canvas.dataset[name]), c => c.charCodeAt(0)).buffer;
  const points = new Int16Array(buffer("points")), faces = new Uint16Array(buffer("faces"));
  const colours = new Uint8Array(buffer("colours"));
  const light = [-0.35, 0.5, 0.79], inside = 0.45;
  const count = points.length / 3;
  const normals = vertexNormals();
  const seen = new Float32Array(count * 3), outer = new Float32Array(count), inner = new Float32Array(count);
  const towards = new Float32Array(count);
  let turn = -0.7, tilt = 0.5, pixels, depth, scale, waiting = false;

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
    canvas.getContext("2d").putImageData(pixels, 0, 0);
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

  function redraw() {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  }

  canvas.addEventListener("pointerdown", event => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    if (!event.buttons) return;
    turn += event.movementX * 0.01;
    tilt = Math.max(-1.6, Math.min(1.6, tilt + event.movementY * 0.01));
    redraw();
  });
  zoom.addEventListener("input", redraw);
  window.addEventListener("resize", fit);
  document.getElementById("viewer").hidden = false;
  fit();
})();
"""

SCRIPT_DIGEST = "sha256-" + base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
"""By which a page's content security policy admits this script and no other."""
