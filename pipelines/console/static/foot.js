// The next steps from a result: the other foot, a second try, both feet, the next person.
"use strict";
(() => {
  const {act, allow, element, hindrance, listen, press, say} = footscan;
  const result = element("result"), {patient, scan, side, posture, level} = result.dataset;

  // A further scan of the sitting is in the posture of this one; the first page asks for another.
  async function film(which) {
    if (!await act("scan", {patient, side: which, posture})) location.assign("/");
  }

  if (element("other")) press(element("other"), () => film(element("other").dataset.side));
  if (element("again")) press(element("again"), () => film(side));
  if (element("new-person")) press(element("new-person"), async () => {
    if (!await act("new-person")) location.assign("/");
  });
  listen(seen => {
    const why = hindrance(seen) || (seen.state.name === "disconnected" ? "The scanner is not connected." : "");
    for (const id of ["other", "again"]) if (element(id)) allow(element(id), why);
    if (element("new-person")) allow(element("new-person"), hindrance(seen));
    say(element("next-told"), why);
    const {pair, feet} = seen.sitting;
    if (element("pair") && scan && seen.sitting.patient === patient && feet.some(foot => foot.scan === scan)) {
      element("pair").hidden = !pair;
      if (pair) element("pair").href = pair;
      const next = level === "poor" ? "again" : pair ? "pair" : "other";
      for (const id of ["pair", "other", "again"])
        if (element(id)) element(id).classList.toggle("main", id === next);
    }
  });
  result.focus();
})();
