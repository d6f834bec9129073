"""The style sheet of all pages: for screens, phones and paper."""

STYLE = """\
:root { --ink: #1c2530; --soft: #5b6672; --rule: #dde2e7; --accent: #1f6f8b; --ground: #f5f7f8; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 15px/1.45 system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; }
header, main { max-width: 1140px; margin: 0 auto; padding: 0 20px; }
header { padding-top: 28px; padding-bottom: 4px; }
header p { margin: 0; color: var(--accent); font-weight: 600; letter-spacing: .02em; }
h1 { margin: 2px 0 12px; font-size: 28px; line-height: 1.2; overflow-wrap: anywhere; }
h1 span { margin-left: .3em; color: var(--soft); font-weight: 400; }
h2 { margin: 0 0 12px; font-size: 18px; overflow-wrap: anywhere; }
section { margin: 0 0 16px; padding: 18px 20px 20px; background: #fff;
  border: 1px solid var(--rule); border-radius: 8px; }
.note { margin: 4px 0 0; color: var(--soft); font-size: 13px; }
h2 + .note { margin: -8px 0 12px; }

.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(140px, 1fr)); gap: 12px; margin-bottom: 16px; }
.tiles div { padding: 10px 14px; background: var(--ground); border-radius: 6px; color: var(--soft); }
main > .tiles div { background: #fff; border: 1px solid var(--rule); }
.tiles span { display: block; font-size: 13px; }
.tiles b { color: var(--ink); font-size: 26px; font-variant-numeric: tabular-nums; }

.wide { overflow-x: auto; }
table { width: 100%; border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 6px 12px 6px 0; text-align: left; vertical-align: top; border-top: 1px solid var(--rule); }
th:last-child, td:last-child { padding-right: 0; }
thead th { border-top: 0; color: var(--soft); font-size: 12.5px; font-weight: 600; vertical-align: bottom; }
tbody th { font-weight: 600; }
.n { text-align: right; }
td { overflow-wrap: anywhere; }
.plain td:not(.n) { min-width: 4em; }
.dense th, .dense td { padding-top: 2px; padding-bottom: 2px; font-size: 13.5px; }
.dense tbody th { white-space: nowrap; }
td.n, .measures td:not(:last-child) { white-space: nowrap; }
.facts { display: grid; grid-template-columns: repeat(auto-fill, minmax(112px, 1fr)); gap: 10px 16px; margin: 0; }
.facts + .note, .wide + .note { margin-top: 10px; }
.views + .facts, .note + .wide { margin-top: 16px; }
h2 + .note + .wide { margin-top: 0; }
.facts + .facts, .facts + .wide, .wide + .wide { margin-top: 14px; }
dt { color: var(--soft); font-size: 13px; }
dd { margin: 0; font-weight: 600; font-variant-numeric: tabular-nums; }
.status { padding: 1px 8px; border-radius: 9px; font-size: 13px; white-space: nowrap; }
.ok { background: #dff2e4; color: #17632f; }
.uncertain { background: #fdf0cf; color: #7a5200; }
.incomplete { background: #fbdfdc; color: #92231a; }

figure { margin: 0; }
svg { display: block; width: 100%; height: auto; }
svg text { fill: var(--soft); font-size: 8.5px; font-variant-numeric: tabular-nums; }
figcaption { margin-bottom: 4px; font-size: 14px; color: var(--soft); }
.views { display: flex; flex-wrap: wrap; gap: 16px; align-items: flex-end; }
.view { width: calc((100% - 16px) / 2 * var(--share)); }
.foot { display: flex; gap: 24px; align-items: flex-start; }
.foot > * { flex: 1 1 0; min-width: 0; }
.list .note { margin: 0 0 4px; }
#viewer[hidden] { display: none; }
.foot #viewer { position: sticky; top: 12px; }
.views #viewer { flex: 1 1 300px; align-self: stretch; display: flex; flex-direction: column; }
.views canvas { flex: 1; }
canvas { display: block; width: 100%; height: 420px; min-height: 260px; background: var(--ground); border-radius: 6px;
  cursor: grab; touch-action: none; }
canvas:active { cursor: grabbing; }
#shown { min-height: 2.8em; margin: 6px 0; font-size: 13.5px; }
.views #shown { display: none; }
.choices, .controls { display: flex; flex-wrap: wrap; gap: 6px; align-items: center; margin: 6px 0; font-size: 13px; }
.choices input { position: absolute; opacity: 0; }
.choices span, .controls button { display: block; padding: 4px 10px; border: 1px solid var(--rule); border-radius: 14px;
  background: #fff; color: var(--ink); font: inherit; cursor: pointer; }
.choices :checked + span { background: var(--accent); border-color: var(--accent); color: #fff; }
.choices :focus-visible + span { outline: 2px solid var(--ink); outline-offset: 1px; }
.controls input[type=range] { flex: 1 1 90px; min-width: 0; max-width: 520px; accent-color: var(--accent); }
.controls label { display: flex; gap: 4px; align-items: center; white-space: nowrap; }
[data-meaning] .key, [data-meaning] .bar { margin: 6px 0 0; }
[data-shows] { padding: 0; border: 0; background: none; color: var(--accent); font: inherit; text-align: left;
  text-decoration: underline dotted; text-underline-offset: 3px; cursor: pointer; }
[data-shows][aria-pressed=true] { color: #b3202c; }
tr:has([data-shows]) { cursor: pointer; }
tr:has([aria-pressed=true]) { background: #fdf2f1; }
#travel[hidden], [data-frame][hidden], [data-meaning][hidden] { display: none; }
[data-frame] + [data-frame] { margin-top: 16px; }
#travel { margin-bottom: 12px; }
#frame { display: inline-block; min-width: 2.5em; font-weight: 600; font-variant-numeric: tabular-nums; }
.missing { margin: 0; padding-left: 20px; overflow-wrap: anywhere; }
.frames .map { background: #fff; border: 1px solid var(--rule); }
.support { fill: #b9d4e8; }
.outline { fill: none; stroke: var(--ink); stroke-width: 1.5; }
.residual { fill: none; stroke: #b3202c; stroke-width: 3; stroke-linecap: round; }
.view svg { overflow: visible; }
.view figcaption { padding-left: 6%; color: var(--ink); font-weight: 600; }
.g1 { stroke: #edf0f2; stroke-width: .35; }
.g5 { stroke: #c9d0d6; stroke-width: .45; }
.key { display: flex; flex-wrap: wrap; gap: 4px 18px; margin: 0 0 12px; font-size: 13.5px; color: var(--soft); }
.wide + .key { margin-top: 16px; }
.key i { display: inline-block; width: 12px; height: 12px; margin-right: 6px; border-radius: 2px; }
.bar { max-width: 500px; margin-bottom: 16px; }
.frame { fill: none; stroke: #8a939c; stroke-width: .6; }
.bar svg text { font-size: 12px; }
.histogram { max-width: 760px; }
.histogram + .histogram { margin-top: 16px; }
.class { fill: #8fbccb; stroke: #fff; stroke-width: .4; }
.histogram svg path { fill: none; }
summary { margin: 4px 0; color: var(--accent); font-size: 14px; cursor: pointer; }
.frames { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(250px, 100%), 1fr)); gap: 16px; }
.clouds { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(340px, 100%), 1fr)); gap: 16px; }
.wide + .clouds { margin-top: 20px; }
.trials svg text { font-size: 11px; }
.clouds img { display: block; width: 100%; border: 1px solid var(--rule); border-radius: 4px; }
.frames figcaption b, .clouds figcaption b { color: var(--ink); }
.frames svg { background: #000; border-radius: 4px; }
.dots { fill: none; stroke: #00f08a; stroke-linecap: round; }

.coverage { display: grid; grid-template-columns: max-content 1fr max-content; column-gap: 12px; row-gap: 6px;
  align-items: end; font-size: 13px; font-variant-numeric: tabular-nums; }
.coverage svg { height: 34px; overflow: visible; border-bottom: 1px solid var(--rule); }
.area { fill: #cfe3ea; }
.line { fill: none; stroke: var(--accent); stroke-width: 1.2;
  vector-effect: non-scaling-stroke; stroke-linejoin: round; }
.ticks { position: relative; height: 1.4em; color: var(--soft); }
.ticks span { position: absolute; transform: translateX(-50%); }
.axis { text-align: center; color: var(--soft); }

.measures, .measures tbody { display: block; }
.measures thead { display: none; }
.measures tr { display: grid; grid-template-columns: 1fr repeat(4, max-content); gap: 0 8px;
  padding: 8px 0; border-top: 1px solid var(--rule); }
.measures th, .measures td { padding: 0; border: 0; }
.measures td:last-child { grid-column: 1 / -1; color: var(--soft); font-size: 13.5px; }

@media (max-width: 700px) {
  header, main { padding-left: 12px; padding-right: 12px; }
  section { padding: 14px 12px 16px; }
  th, td { padding-right: 8px; }
  .foot { flex-direction: column; align-items: stretch; gap: 8px; }
  .foot #viewer { top: 0; z-index: 1; padding: 4px 0; background: #fff; }
  .foot canvas { height: 32vh; min-height: 200px; }
  .foot .choices, .foot .controls { flex-wrap: nowrap; overflow-x: auto; }
  .foot .choices > *, .foot .controls > * { flex-shrink: 0; }
  .foot .choices label { position: relative; white-space: nowrap; }
  .foot [data-meaning] .key { gap: 2px 10px; font-size: 12px; }
  .foot [data-meaning] .note { display: none; }
  #shown { margin: 2px 0; }
  .views { gap: 16px 0; }
  .view { width: calc(100% * var(--share)); }
}
@media print {
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  body { background: #fff; font-size: 10.5pt; }
  header, main { max-width: none; padding-left: 0; padding-right: 0; }
  section { padding: 0 0 8px; border: 0; }
  #viewer, .controls, .list > .note { display: none; }
  .foot { display: block; }
  .frames { grid-template-columns: repeat(4, 1fr); gap: 10px; }
  figure, tr, .coverage { break-inside: avoid; }
  h2 { break-after: avoid; }
}
"""
