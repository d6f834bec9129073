"""The page from which a scan is made."""

from pipelines.console.pages.shell import shell


def sitting_page() -> str:
    """Return the page; `sitting.js` fills it with the state from the server."""
    return shell(title="footscan", parts=[_MAIN], scripts=["cameras.js", "sitting.js"])


_MAIN = """\
<h1 class="hidden">Scan a foot</h1>
<div id="do" hidden><span id="do-words" role="status"></span>
<button id="resume" class="main" type="button" hidden>Go on</button></div>
<div class="sides"><div>
<section id="order"><h2>Scan</h2>
<form id="scan" autocomplete="off" novalidate>
<label for="patient">Pseudonym</label>
<input id="patient" name="patient" maxlength="64" spellcheck="false" autocapitalize="off"
 aria-describedby="patient-told">
<p id="patient-told" class="note" aria-live="polite">1 to 64 letters, digits, - and _</p>
<fieldset><legend>Foot on the glass</legend><div class="two">
<label><input type="radio" name="side" value="left"><span>Left</span></label>
<label><input type="radio" name="side" value="right" checked><span>Right</span></label></div></fieldset>
<label for="posture">Posture and load</label>
<select id="posture" name="posture"><option value="">choose</option>
<option value="half_weight">Standing, weight on both feet</option>
<option value="standing">Standing, weight on this foot</option>
<option value="sitting">Sitting</option><option value="unknown">Not known</option></select>
<button id="start" class="main" type="submit">Start the scan</button>
<p id="start-told" class="note" aria-live="polite"></p>
<details><summary>If a camera fails</summary>
<label class="check"><input type="checkbox" id="keep"> keep the scan without that camera</label></details>
</form></section>
<section id="sitting"><h2>This sitting</h2><p id="who" class="note">Nobody yet.</p><ol id="feet"></ol>
<div class="row"><a id="pair" class="button main" hidden>Both feet</a>
<button id="new-person" type="button" hidden>Next person</button></div></section>
<section id="machine"><h2>Heads and light</h2>
<div class="row"><button id="connect" type="button">Connect</button><button id="home" type="button">Home heads</button>
<button id="shine" type="button">Show the stripe</button>
<a class="button" href="/calibrating">Calibrate or check</a></div>
<details><summary>Move heads by hand</summary><fieldset class="jog"><legend>Along the travel, lasers off</legend>
<label>Which <select id="jog-head"><option value="">all heads</option></select></label>
<div class="row"><button type="button" data-jog="-50">−50 mm</button><button type="button" data-jog="-5">−5 mm</button>
<button type="button" data-jog="5">+5 mm</button><button type="button" data-jog="50">+50 mm</button></div>
</fieldset></details></section>
</div><div>
<section id="cameras"><h2>Cameras</h2><div id="pictures"></div></section>
<section id="devices"><h2>Devices</h2><ul id="device-list"></ul></section>
</div></div>
"""
