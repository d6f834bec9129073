// The link between a page and the server: the stream of states, orders, and Stop, which is always available.
"use strict";
const footscan = (() => {
  const NAMES = {disconnected: "Not connected", idle: "Ready", preparing: "Please wait", homing: "Homing",
    filming: "Filming", storing: "Storing", reconstructing: "Reconstructing", done: "Done", failed: "Failed", "door open": "Door open", alarm: "Alarm"};
  const LEVELS = {disconnected: "bad", idle: "ok", done: "ok", failed: "bad", alarm: "bad", "door open": "warning"};
  const PRESENT_MS = 150, STOP_SOON_MS = 60, STOP_LATE_MS = 1000;
  const SWITCH = "The server does not answer. To switch the lasers off at once, use the scanner’s own switch.";
  const listeners = [];
  let latest = null;

  // The name of this page for the server; it lives as long as the tab.
  function pageName() {
    let name = sessionStorage.getItem("page");
    if (!name) {
      name = [...crypto.getRandomValues(new Uint8Array(16))].map(byte => byte.toString(16).padStart(2, "0")).join("");
      sessionStorage.setItem("page", name);
    }
    return name;
  }

  const page = pageName(), element = id => document.getElementById(id);

  function made(tag, words = "", kind = "") {
    const node = document.createElement(tag);
    node.textContent = words;
    if (kind) node.className = kind;
    return node;
  }

  // Elements that a screen reader announces change only if their text changes.
  function say(node, words) {
    if (node.textContent !== words) node.textContent = words;
  }

  function told(words) {
    say(element("told"), words);
    element("told").hidden = !words;
  }

  // While heads are moved by hand, this page reports several times a second that it is there; else the server stops them.
  let present = null;
  function stayPresent(is) {
    if (is === (present !== null)) return;
    let waits = false;
    const speak = async () => {
      if (waits) return;
      waits = true;
      try {
        await fetch("/here", {method: "POST", headers: {"X-Footscan-Page": page}, priority: "high"});
      } catch {
        // Without the report the server stops the heads.
      }
      waits = false;
    };
    if (!is) clearInterval(present);
    present = is ? setInterval(speak, PRESENT_MS) : null;
  }

  // Gives an order; resolves to the problem, or to null.
  async function act(name, body = {}) {
    let problem = null;
    if (name === "jog") stayPresent(true);
    try {
      const answer = await fetch(`/do/${name}`, {method: "POST", body: JSON.stringify(body),
        headers: {"X-Footscan-Page": page, "Content-Type": "application/json"}});
      if (!answer.ok) problem = await problemOf(answer);
    } catch {
      problem = SWITCH;
    }
    if (name === "jog" && problem) stayPresent(false);
    told(problem || "");
    return problem;
  }

  async function problemOf(answer) {
    const text = await answer.text();
    try {
      return JSON.parse(text).problem;
    } catch {
      return text.trim();
    }
  }

  function show(seen) {
    if (latest && latest.action === "jog" && seen.action !== "jog") stayPresent(false);
    latest = seen;
    const {name, words, progress, left_s: left} = seen.state;
    element("state").dataset.level = LEVELS[name] || "busy";
    say(element("state-name"), NAMES[name] || name);
    say(element("state-words"), name === "done" ? "" : words);
    const count = name === "filming" ? countOf(seen.frames) : "";
    element("count").textContent = [count, left ? timeLeft(left) : ""].filter(Boolean).join(", ");
    element("progress").hidden = progress === null;
    if (progress !== null) element("progress").value = progress;
    element("others").hidden = seen.in_charge || !seen.others;
    told([seen.warning, words.includes(seen.problem) ? null : seen.problem].filter(Boolean).join(". "));
    for (const listener of listeners) listener(seen);
  }

  const counted = (count, what) => `${count.toLocaleString("en")} ${what}${count === 1 ? "" : "s"}`;

  const timeLeft = seconds => seconds < 95 ? `about ${10 * Math.round(seconds / 10)} s left` : `about ${Math.round(seconds / 60)} min left`;

  // Not announced by a screen reader: it changes every second.
  function countOf(frames) {
    const counts = Object.values(frames);
    return `${counted(counts.reduce((sum, count) => sum + count, 0), "frame")} of ${counted(counts.length, "camera")}`;
  }

  function lost() {
    element("state").dataset.level = "bad";
    say(element("state-name"), "No connection to the server");
    say(element("state-words"), "Is “footscan console” still running? This page tries again by itself.");
    element("progress").hidden = true;
    element("count").textContent = "";
  }

  // A browser opens six connections per port of a server, and other tabs and downloads may use them all: Stop first goes
  // to a port of its own, and also the usual way if that is not answered soon.
  async function stopAside() {
    if (!latest || !latest.stop_port) return false;
    const answer = await fetch(`http://${location.hostname}:${latest.stop_port}/do/stop`,
      {method: "POST", body: "{}", credentials: "include", priority: "high"});
    if (!answer.ok) throw new Error(await problemOf(answer));
    return true;
  }

  async function stop() {
    element("stop").classList.add("pressed");
    setTimeout(() => element("stop").classList.remove("pressed"), 600);
    const aside = stopAside().catch(() => false);
    const soon = await Promise.race([aside, new Promise(done => setTimeout(done, STOP_SOON_MS, false))]);
    if (soon) return null;
    const late = setTimeout(told, STOP_LATE_MS, SWITCH);
    const usual = act("stop");
    const done = await Promise.race([usual.then(problem => !problem), aside.then(is => is || usual.then(one => !one))]);
    clearTimeout(late);
    if (done) told("");
    return done ? null : usual;
  }

  function follow() {
    const events = new EventSource(`/events?page=${page}`);
    events.onmessage = event => show(JSON.parse(event.data));
    events.onerror = () => {
      lost();
      if (events.readyState === EventSource.CLOSED) setTimeout(follow, 2000);
    };
    addEventListener("pagehide", () => events.close());
  }

  // A page that is left, hidden or frozen shows neither the heads nor a button to stop them.
  addEventListener("pagehide", () => stayPresent(false));
  document.addEventListener("freeze", () => stayPresent(false));
  document.addEventListener("visibilitychange", () => { if (document.hidden) stayPresent(false); });
  addEventListener("pageshow", event => { if (event.persisted) location.reload(); });
  element("stop").addEventListener("click", stop);
  document.addEventListener("keydown", event => {
    if (event.key !== "Escape" || event.repeat) return;
    event.preventDefault();
    stop();
  }, true);
  element("take-over").addEventListener("click", () => act("take-over"));
  follow();

  return {
    act, say, element, made, counted,
    // Calls `listener` with the latest state, and with each new one.
    listen(listener) {
      listeners.push(listener);
      if (latest) listener(latest);
    },
    // Disables a button while `why` is not empty; the button keeps the focus.
    allow(button, why) {
      button.setAttribute("aria-disabled", String(Boolean(why)));
      button.title = why || "";
    },
    // Calls `order` on each click on a button that is not disabled.
    press(button, order) {
      button.addEventListener("click", event => {
        event.preventDefault();
        if (button.getAttribute("aria-disabled") !== "true") order();
      });
    },
    // Why no order can be given now; "" if one can.
    hindrance(seen) {
      if (!seen.in_charge && seen.others) return "Another page is in charge.";
      if (seen.action !== null) return "The scanner is busy.";
      return "";
    },
  };
})();
