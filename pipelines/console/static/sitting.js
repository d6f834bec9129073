// The page from which a scan is made.
"use strict";
(() => {
  const {act, allow, element, hindrance, listen, made, press, say} = footscan;
  const SIDES = {right: "Right foot", left: "Left foot"};
  const MARKS = {ok: "✓", warning: "!", bad: "✕", unknown: "?"};
  const PSEUDONYM = /^[A-Za-z0-9_-]{1,64}$/;
  const patient = element("patient"), form = element("scan");
  let seen = null, before = null, listed = "", fed = "";

  const chosenSide = () => form.elements.side.value;

  // Checked while typing: wrong letters are reported at once, a missing pseudonym only at the start.
  function patientProblem() {
    const name = patient.value;
    if (PSEUDONYM.test(name)) return "";
    const wrong = [...new Set([...name].filter(letter => !/[A-Za-z0-9_-]/.test(letter)))];
    if (wrong.length)
      return `Only letters, digits, - and _ are allowed, no ${wrong.map(w => w === " " ? "space" : `“${w}”`).join(", ")}.`;
    return name ? "At most 64 characters." : "";
  }

  function checkPatient() {
    const problem = patientProblem();
    patient.setAttribute("aria-invalid", String(Boolean(problem)));
    say(element("patient-told"), problem || "1 to 64 letters, digits, - and _");
    element("patient-told").classList.toggle("wrong", Boolean(problem));
    showStart();
  }

  function showStart() {
    if (!seen) return;
    const why = hindrance(seen) || (seen.state.name === "disconnected" ? "Connect the scanner first." : "")
      || (seen.state.name === "door open" ? "Close the door first." : "")
      || (seen.state.name === "alarm" ? "Home the heads first." : "")
      || (PSEUDONYM.test(patient.value) ? "" : patient.value ? "The pseudonym is not valid." : "A pseudonym is missing.")
      || (form.elements.posture.value ? "" : "Choose the posture.");
    allow(element("start"), why);
    say(element("start-told"), why);
    say(element("start"), `Scan the ${chosenSide()} foot`);
  }

  async function start() {
    if (element("start").getAttribute("aria-disabled") === "true") {
      if (!PSEUDONYM.test(patient.value)) patient.focus();
      else if (!form.elements.posture.value) form.elements.posture.focus();
      return;
    }
    await act("scan", {
      patient: patient.value, side: chosenSide(), posture: form.elements.posture.value,
      keep_partial: element("keep").checked,
    });
  }

  function showSitting({patient: name, feet, pair}) {
    const now = JSON.stringify([name, feet, pair]);
    if (now === fed) return;
    const first = fed === "";
    fed = now;
    if (name && (first || !patient.value)) patient.value = name;
    say(element("who"), name || "Nobody yet.");
    element("feet").replaceChildren(...feet.map(foot => {
      const item = made("li"), length = foot.length_mm === null ? "" : `${foot.length_mm.toFixed(1)} mm`;
      item.append(foot.href ? Object.assign(made("a", SIDES[foot.side]), {href: foot.href}) : made("b", SIDES[foot.side]));
      item.append(" ", made("span", foot.problem ? "not measured" : foot.level, `light ${foot.level}`), " ", length);
      for (const words of [foot.problem, ...foot.left_out]) if (words) item.append(made("p", words, "note"));
      return item;
    }));
    const last = feet.at(-1);
    if (last && last.href && feet.every(foot => !foot.href || foot.side === last.side))
      form.elements.side.value = last.side === "right" ? "left" : "right";
    element("pair").hidden = !pair;
    if (pair) element("pair").href = pair;
    element("new-person").hidden = !name;
    checkPatient();
  }

  function showDevices(devices) {
    const now = JSON.stringify(devices);
    if (now === listed) return;
    listed = now;
    element("device-list").replaceChildren(...devices.map(device => {
      const item = made("li"), mark = made("i", MARKS[device.level]), words = made("div");
      item.dataset.level = device.level;
      mark.setAttribute("role", "img");
      mark.setAttribute("aria-label", device.level);
      words.append(made("b", device.name), " ", made("span", device.words));
      if (device.remedy) words.append(made("p", device.remedy, "note"));
      item.append(mark, words);
      return item;
    }));
    const worst = ["bad", "warning", "unknown", "ok"].find(level => devices.some(device => device.level === level));
    element("devices").dataset.level = worst || "unknown";
  }

  // The heads that may be moved alone are those that the scanner reports.
  function showHeads(devices) {
    const heads = devices.map(part => /^Head (\d+)$/.exec(part.name)).filter(found => found).map(found => found[1]);
    const which = element("jog-head");
    if (which.dataset.heads === String(heads)) return;
    which.dataset.heads = String(heads);
    which.replaceChildren(new Option("all heads", ""), ...heads.map(head => new Option(`head ${head}`, head)));
  }

  // The page in charge opens a result as soon as it can be shown.
  function goToResult(now) {
    const last = now.sitting.feet.at(-1);
    if (before && now.in_charge && last && last.href && last.href !== before.sitting.feet.at(-1)?.href)
      location.assign(last.href);
  }

  listen(now => {
    seen = now;
    say(element("do-words"), now.do);
    element("do").hidden = !now.do;
    showSitting(now.sitting);
    showDevices(now.devices);
    showHeads(now.devices);
    const why = hindrance(now), there = now.state.name === "disconnected" ? "Connect the scanner first." : "";
    for (const id of ["connect", "new-person"]) allow(element(id), why);
    for (const button of [element("home"), element("shine"), ...document.querySelectorAll("[data-jog]")])
      allow(button, why || there);
    element("resume").hidden = !(now.resumable && now.action === "scan");
    showStart();
    goToResult(now);
    before = now;
  });

  patient.addEventListener("input", checkPatient);
  form.addEventListener("change", showStart);
  form.addEventListener("submit", event => { event.preventDefault(); start(); });
  for (const id of ["connect", "home", "shine", "resume"]) press(element(id), () => act(id));
  for (const button of document.querySelectorAll("[data-jog]"))
    press(button, () => act("jog", {mm: Number(button.dataset.jog), head: Number(element("jog-head").value) || null}));
  press(element("new-person"), async () => {
    if (await act("new-person")) return;
    patient.value = form.elements.posture.value = "";
    fed = "";
    patient.focus();
  });
})();
