// Landmarks and choices of a scan: what is moved or chosen is measured at once, and written by "Save and measure".
"use strict";
(() => {
  const element = id => document.getElementById(id), all = selector => [...document.querySelectorAll(selector)];
  const canvas = element("canvas"), name = element("scan").dataset.name;
  const middle = JSON.parse(canvas.dataset.middle), unit = Number(canvas.dataset.unit);
  const armed = all("input[name=armed]"), key = Object.fromEntries(armed.map(one => [one.value, one.dataset.name]));
  const label = Object.fromEntries(armed.map(one => [one.dataset.name, one.value]));
  const page = [...crypto.getRandomValues(new Uint8Array(16))].map(b => b.toString(16).padStart(2, "0")).join("");
  const start = JSON.parse(canvas.dataset.landmarks), moved = {}, back = new Set();
  let asked = 0;

  function told(words) {
    element("told").textContent = words;
    element("told").hidden = !words;
  }

  // Landmarks that a person has moved on this page, in mm of the view, and those to be found again by the program.
  function edit() {
    const place = Object.fromEntries(Object.entries(moved).map(([one, at]) => [one, at.map((v, k) => middle[k] + v * unit)]));
    const chosen = id => element(id).value || null;
    return {moved: place, back: [...back], axis: chosen("axis"), posture: chosen("posture"), people: chosen("people"),
      exports: all("input[name=export]:checked").map(one => one.value), notes: element("notes").value,
      by: element("by").value};
  }

  async function post(what) {
    const answer = await fetch(`/edit/${name}/${what}`, {method: "POST", body: JSON.stringify(edit()),
      headers: {"X-Footscan-Page": page, "Content-Type": "application/json"}});
    const body = await answer.text();
    if (!answer.ok) throw new Error(body.startsWith("{") ? JSON.parse(body).problem : body);
    return JSON.parse(body);
  }

  async function tryIt() {
    const mine = ++asked;
    element("busy").textContent = "Measuring …";
    element("save").disabled = element("undo").disabled = false;
    try {
      const {measures, landmarks} = await post("try");
      if (mine !== asked) return;
      told("");
      element("changes").replaceChildren();
      for (const [one, {label: words, now, change, status, unit: in_}] of Object.entries(measures)) {
        if (change) {
          const line = document.createElement("li");
          line.textContent = `${words}: ${now} ${in_} (${change})`;
          element("changes").append(line);
        }
        const cell = document.querySelector(`[data-now="${one}"]`);
        if (cell === null) continue;
        cell.textContent = now;
        document.querySelector(`[data-change="${one}"]`).textContent = change;
        const state = document.querySelector(`[data-status="${one}"]`);
        state.textContent = status;
        state.className = `status ${status}`;
      }
      for (const [one, place] of Object.entries(landmarks)) show(one, place.map((v, k) => (v - middle[k]) / unit));
      element("busy").textContent = "Not saved yet.";
    } catch (problem) {
      if (mine !== asked) return;
      told(problem.message);
      element("busy").textContent = "";
    }
  }

  function show(one, place) {
    canvas.dispatchEvent(new CustomEvent("place", {detail: {name: label[one], place}}));
  }

  canvas.addEventListener("landmark", event => {
    const one = key[event.detail.name];
    moved[one] = event.detail.place;
    back.delete(one);
    element(`how-${one}`).textContent = "moved on this page";
    document.querySelector(`[data-back="${one}"]`).hidden = false;
    tryIt();
  });
  for (const one of armed) one.addEventListener("change", () => { canvas.dataset.armed = one.value; });
  for (const button of all("[data-back]")) button.addEventListener("click", () => {
    const one = button.dataset.back, how = element(`how-${one}`);
    delete moved[one];
    if (how.dataset.set) back.add(one);
    how.textContent = "found by the program";
    button.hidden = true;
    show(one, start[label[one]] ?? null);
    tryIt();
  });
  for (const id of ["axis", "posture", "people"]) element(id).addEventListener("change", tryIt);
  for (const one of all("input[name=export]")) one.addEventListener("change", tryIt);
  element("notes").addEventListener("input", () => { element("save").disabled = element("undo").disabled = false; });
  element("undo").addEventListener("click", () => location.reload());
  element("save").addEventListener("click", async () => {
    element("save").disabled = true;
    element("busy").textContent = "Saving and measuring …";
    asked++;
    try {
      await post("save");
      location.reload();
    } catch (problem) {
      told(problem.message);
      element("busy").textContent = "";
      element("save").disabled = false;
    }
  });
})();
