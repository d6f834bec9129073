"""The page on which the scanner is calibrated and checked."""

from pipelines.console.pages.shell import shell


def calibrating_page() -> str:
    """Return the page; `calibrating.js` fills it with the state from the server."""
    return shell(title="footscan: calibrate", parts=[_MAIN], scripts=["cameras.js", "calibrating.js"])


_MAIN = """\
<h1 class="hidden">Calibrate the scanner</h1>
<div id="do" hidden><span id="do-words" role="status"></span></div>
<div class="sides"><div>
<section id="guide"><h2 id="step-name">Calibrate the scanner</h2>
<p id="step-words" role="status"></p>
<ul id="complaints" role="alert" hidden></ul>
<button id="usual" class="main" type="button" hidden>Begin</button>
<p id="usual-told" class="note" aria-live="polite"></p>
<div id="others-now" class="row"></div>
<p id="price" class="note" aria-live="polite"></p>
<details id="all-placements" hidden><summary>All placements</summary><div id="numbers" class="row"></div></details>
</section>
<section id="machine"><h2>Scanner</h2>
<div class="row"><button id="connect" type="button">Connect</button><button id="home" type="button">Home heads</button>
<button id="shine" type="button">Show the stripe</button><a class="button" href="/">Scan feet</a></div></section>
</div><div>
<section id="placing" hidden><h2>Where to put it</h2><img id="placement" alt=""></section>
<section id="outcome" hidden><h2 id="outcome-name">Result</h2><ul id="remarks"></ul>
<div class="wide"><table class="plain"><thead><tr id="outcome-columns"></tr></thead>
<tbody id="outcome-rows"></tbody></table></div>
<div id="planes" hidden><h3>Where the laser planes lie</h3>
<div class="wide"><table class="plain"><thead><tr id="plane-columns"></tr></thead>
<tbody id="plane-rows"></tbody></table></div>
<p class="note">From the film of the body, with standard deviations. X counts from the mean of the heads; travel is the
error of its millimetres. What the films do not support is left at zero.</p></div><p id="outcome-file" class="note"></p>
<img id="outcome-picture" alt="Residuals and coverage of each camera" hidden></section>
<section id="covered" hidden><h2>Covered so far</h2>
<p class="note">The stripe in each camera’s picture: the latest placement in orange, earlier ones in blue. The
calibration will hold in the region between them.</p><img id="stripes" alt=""></section>
<section id="cameras"><h2>Cameras</h2><div id="pictures"></div></section>
</div></div>
"""
