// The page on which the scanner is calibrated and checked, placement by placement.
"use strict";
(() => {
  const {act, allow, element, hindrance, listen, made, press, say} = footscan;
  const NAMES = {put: "Put the virtual object there", take: "Film this placement", next: "Next placement",
    discard: "Discard this session", body: "Film the body, too", "film-body": "Film the body", use: "Use it for scans",
    calibrate: "Calibrate the scanner", check: "Check the calibration"};
  const STEPS = {begin: "Calibrate or check", place: "Place the object",
    filmed: "All placements are filmed", calibrated: "The scanner is calibrated", body: "Place the body",
    planes: "The laser planes are found", used: "The calibration is in use", checked: "The calibration is checked"};
  const SURE_MS = 5000;
  let usual = "", step = "", drawn = "", placed = "", shown = "", told = "";

  // The minus of a number, or of an axis, is longer than a hyphen.
  const minus = words => words.replace(/(?<!\w)-(?=[\dYZ])/g, "−");

  function headingOf({step, number, complaints}) {
    if (step !== "look") return STEPS[step];
    return `Placement ${number + 1}: ${complaints.length ? "film again" : "good"}`;
  }

  function nameOf(action, view) {
    if (action === "finish") return view.purpose === "check" ? "Check the calibration" : "Calibrate";
    if (action === "take" && view.step === "look") return "Film it again";
    if (action === "put" && view.step === "body") return "Put the virtual body there";
    if (action === "end" && view.step === "used") return "Scan a foot";
    if (action === "end" && ["used", "checked"].includes(view.step)) return "Done";
    if (action === "end") return view.outcome ? "Leave without using it" : "Leave; what is filmed stays";
    return NAMES[action];
  }

  const give = (action, number = 0) => act("calibrate", {action, number});

  async function giveUsual() {
    const scans = usual === "end" && step === "used";
    const problem = await give(usual);
    if (scans && !problem) location.assign("/");
  }

  function button(action, view) {
    const node = made("button", nameOf(action, view));
    node.type = "button";
    node.dataset.action = action;
    if (action === "discard") press(node, () => discard(node));
    else press(node, () => give(action));
    return node;
  }

  // What was filmed is removed on the second click alone.
  function discard(node) {
    if (node.dataset.sure) return give("discard");
    node.dataset.sure = "yes";
    node.textContent = "Remove all frames of this session?";
    setTimeout(() => {
      delete node.dataset.sure;
      node.textContent = NAMES.discard;
    }, SURE_MS);
    return null;
  }

  function showSteps(view, why) {
    const now = JSON.stringify([view.step, view.actions, view.purpose]);
    if (now !== shown) {
      const focused = document.activeElement;
      const within = element("others-now").contains(focused) || element("numbers").contains(focused);
      shown = now;
      usual = view.actions[0] || "";
      step = view.step;
      say(element("usual"), usual ? nameOf(usual, view) : "");
      element("usual").hidden = !usual;
      element("others-now").replaceChildren(...view.actions.slice(1).filter(action => action !== "go")
        .map(action => button(action, view)));
      if (within) element("usual").focus();
    }
    for (const one of [element("usual"), ...element("others-now").children, ...element("numbers").children]) allow(one, why);
    say(element("usual-told"), why);
  }

  // What is to be filmed, drawn by the server from what the calibration takes it for.
  function showPlacement(view) {
    const isBody = view.step === "body", at = view.number === null ? null : view.placements[view.number];
    element("placing").hidden = !isBody && !(at && ["place", "look"].includes(view.step));
    const now = JSON.stringify([isBody, view.folder, view.number, view.taken]);
    if (element("placing").hidden || now === placed) return;
    placed = now;
    const what = isBody ? "The body on the glass" : `The object at Y = ${at[0]} mm, ${at[1]} mm above the glass`;
    element("placement").alt = minus(`${what}: seen from the front, from the side and from above`);
    element("placement").src = `/calibrating/placement.svg?${Date.now()}`;
  }

  function showNumbers(view, why) {
    element("all-placements").hidden = !view.actions.includes("go");
    const now = JSON.stringify([view.number, view.taken, view.placements]);
    if (now === element("numbers").dataset.now) return;
    element("numbers").dataset.now = now;
    element("numbers").replaceChildren(...view.placements.map(([y, z], number) => {
      const taken = view.taken.includes(number), one = made("button", `${number + 1}${taken ? " ✓" : ""}`);
      one.type = "button";
      one.setAttribute("aria-label", minus(`Placement ${number + 1}: Y = ${y} mm, Z = ${z} mm${taken ? ", filmed" : ""}`));
      if (number === view.number) one.setAttribute("aria-current", "step");
      press(one, () => give("go", number));
      allow(one, why);
      return one;
    }));
  }

  function fill(table, columns, rows) {
    element(`${table}-columns`).replaceChildren(...columns.map(words => made("th", words)));
    element(`${table}-rows`).replaceChildren(...rows.map(row => {
      const line = made("tr");
      line.append(...row.map(cell => made("td", minus(cell))));
      return line;
    }));
  }

  function showOutcome(view) {
    const outcome = view.outcome;
    element("outcome").hidden = !outcome;
    if (!outcome || told === JSON.stringify(outcome)) return;
    told = JSON.stringify(outcome);
    element("outcome").dataset.level = outcome.is_well ? "ok" : "bad";
    element("remarks").replaceChildren(...outcome.remarks.map(words => made("li", minus(words))));
    fill("outcome", outcome.columns, outcome.rows);
    fill("plane", outcome.plane_columns, outcome.planes);
    element("planes").hidden = !outcome.planes.length;
    say(element("outcome-file"), outcome.file);
    element("outcome-picture").hidden = !outcome.has_picture;
    if (outcome.has_picture) element("outcome-picture").src = `/calibrating/result.png?${Date.now()}`;
  }

  function show(now) {
    const view = now.guide;
    say(element("do-words"), now.do);
    element("do").hidden = !now.do;
    const busy = hindrance(now);
    const there = busy || (now.state.name === "disconnected" ? "Connect the scanner first." : "");
    allow(element("connect"), busy);
    for (const id of ["home", "shine"]) allow(element(id), there);
    if (!view) {
      say(element("step-words"), "There is no reference object: put its file reference.yaml beside rig.yaml, or start "
        + "the console with --reference.");
      element("usual").hidden = true;
      return;
    }
    const why = there || (now.state.name === "door open" ? "Close the door first." : "")
      || (now.state.name === "alarm" ? "Home the heads first." : "");
    say(element("step-name"), headingOf(view));
    say(element("step-words"), minus(view.words));
    const complaints = element("complaints"), words = view.complaints.map(one => minus(one.words));
    complaints.hidden = !words.length;
    if ([...complaints.children].map(one => one.textContent).join("\n") !== words.join("\n"))
      complaints.replaceChildren(...words.map(one => made("li", one)));
    showPlacement(view);
    showNumbers(view, why);
    showSteps(view, why);
    say(element("price"), view.price);
    showOutcome(view);
    const covered = Object.entries(view.coverage);
    element("covered").hidden = !covered.length || Boolean(view.outcome);
    if (covered.length && drawn !== `${view.folder} ${view.drawn}`) {
      drawn = `${view.folder} ${view.drawn}`;
      element("stripes").src = `/calibrating/stripes.svg?${view.drawn}`;
      element("stripes").alt = covered.map(([camera, share]) => `camera ${camera}: ${Math.round(100 * share)} %`).join(", ");
    }
  }

  listen(show);
  press(element("usual"), giveUsual);
  for (const id of ["connect", "home", "shine"]) press(element(id), () => act(id));
})();
