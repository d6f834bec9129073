// Live pictures of the cameras, on the pages that have a place for them.
"use strict";
(() => {
  const {counted, element, listen, made, say} = footscan;
  const CLEAR_POINTS = 100;  // glints of the scanner itself give some points
  let seen = null, pictured = "";

  function showCameras({cameras, devices, frames, state}) {
    if (pictured !== String(cameras)) {
      pictured = String(cameras);
      element("pictures").replaceChildren(...cameras.map(camera => {
        const figure = made("figure"), caption = made("figcaption"), picture = made("img");
        figure.id = `camera-${camera}`;
        picture.alt = "";
        picture.hidden = true;
        caption.append(made("b", `Camera ${camera}`), " ", made("span", "no picture yet"));
        figure.append(picture, made("div", "no picture", "dark"), caption);
        return figure;
      }));
    }
    for (const camera of cameras) {
      const figure = element(`camera-${camera}`);
      const device = devices.find(part => part.name === `Camera ${camera}`);
      figure.dataset.level = device ? device.level : "unknown";
      if (state.name === "filming") say(figure.querySelector("span"), counted(frames[camera] ?? 0, "frame"));
    }
  }

  // In the dark, the search for the stripe finds room light and glints.
  const mayShine = ({action, state}) => action === "shine" || state.name === "filming";

  // One picture after another, so as not to overload a slow line; less often while the scanner films.
  async function lookOn() {
    for (let turn = 0; ; turn++) {
      const cameras = seen ? seen.cameras : [], filming = seen && seen.state.name === "filming";
      await new Promise(done => setTimeout(done, !cameras.length || document.hidden ? 1000 : filming ? 500 : 120));
      if (cameras.length && !document.hidden) await look(cameras[turn % cameras.length]);
    }
  }

  async function look(camera) {
    const figure = element(`camera-${camera}`);
    if (!figure) return;
    const picture = figure.querySelector("img"), caption = figure.querySelector("span");
    const litBefore = mayShine(seen);
    try {
      const answer = await fetch(`/cameras/${camera}.jpg`), is = answer.status === 200;
      const old = picture.src;
      if (is) picture.src = URL.createObjectURL(await answer.blob());
      if (old) URL.revokeObjectURL(old);
      if (!is) picture.removeAttribute("src");
      picture.hidden = !is;
      figure.querySelector(".dark").hidden = is;
      const points = Number(answer.headers.get("X-Stripe-Points") || 0), lit = litBefore && mayShine(seen);
      const clear = points >= CLEAR_POINTS, found = clear ? ", with the stripe found" : ", no clear stripe in it";
      picture.alt = is ? `Camera ${camera} now${lit ? found : ""}` : "";
      const words = lit ? (clear ? `stripe: ${points} points` : "no clear stripe") : "live";
      if (seen.state.name !== "filming") say(caption, is ? words : "no picture");
    } catch {
      picture.hidden = true;
      figure.querySelector(".dark").hidden = false;
    }
  }

  listen(now => {
    seen = now;
    showCameras(now);
  });
  lookOn();
})();
