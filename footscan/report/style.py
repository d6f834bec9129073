"""How the page looks: on a screen, on a phone and on paper."""

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
h2 { margin: 0 0 12px; font-size: 18px; }
section { margin: 0 0 16px; padding: 18px 20px 20px; background: #fff;
  border: 1px solid var(--rule); border-radius: 8px; }
.note { margin: 4px 0 0; color: var(--soft); font-size: 13px; }
h2 + .note { margin: -8px 0 12px; }

.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(140px, 1fr)); gap: 12px; margin-bottom: 16px; }
.tiles div { padding: 10px 14px; background: var(--ground); border-radius: 6px; color: var(--soft); }
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
td.n, .measures td:not(:last-child) { white-space: nowrap; }
.facts { display: grid; grid-template-columns: repeat(auto-fill, minmax(112px, 1fr)); gap: 10px 16px; margin: 0; }
.facts + .note { margin-top: 10px; }
.facts + .facts, .facts + .wide { margin-top: 14px; }
dt { color: var(--soft); font-size: 13px; }
dd { margin: 0; font-weight: 600; font-variant-numeric: tabular-nums; }
.status { padding: 1px 8px; border-radius: 9px; font-size: 13px; white-space: nowrap; }
.ok { background: #dff2e4; color: #17632f; }
.uncertain { background: #fdf0cf; color: #7a5200; }
.incomplete { background: #fbdfdc; color: #92231a; }

figure { margin: 0; }
.picture { display: block; width: 100%; margin-top: 12px; }
svg { display: block; width: 100%; height: auto; }
svg text { fill: var(--soft); font-size: 8.5px; font-variant-numeric: tabular-nums; }
figcaption { margin-bottom: 4px; font-size: 14px; color: var(--soft); }
.views { display: flex; flex-wrap: wrap; gap: 16px; align-items: flex-end; }
.view { width: calc((100% - 16px) / 2 * var(--share)); }
#viewer { flex: 1 1 300px; align-self: stretch; display: flex; flex-direction: column; }
#viewer[hidden] { display: none; }
#viewer figcaption { display: flex; gap: .6em; align-items: center; color: var(--ink); font-weight: 600; }
#viewer figcaption span { color: var(--soft); font-weight: 400; flex: 1; }
#viewer input { width: 110px; accent-color: var(--accent); }
canvas { flex: 1; width: 100%; min-height: 260px; background: var(--ground); border-radius: 6px;
  cursor: grab; touch-action: pan-y; }
canvas:active { cursor: grabbing; }
.view svg { overflow: visible; }
.view figcaption { padding-left: 6%; color: var(--ink); font-weight: 600; }
.g1 { stroke: #edf0f2; stroke-width: .35; }
.g5 { stroke: #c9d0d6; stroke-width: .45; }
.bar { max-width: 500px; margin-bottom: 16px; }
.frame { fill: none; stroke: #8a939c; stroke-width: .6; }
.bar svg text { font-size: 12px; }
.histogram { max-width: 760px; }
.histogram + .histogram { margin-top: 16px; }
.class { fill: #8fbccb; stroke: #fff; stroke-width: .4; }
.histogram svg path { fill: none; }
summary { margin: 4px 0; color: var(--accent); font-size: 14px; cursor: pointer; }
.frames { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(250px, 100%), 1fr)); gap: 16px; }
.frames figcaption b { color: var(--ink); }
.frames svg { background: #000; border-radius: 4px; }
.dots { fill: none; stroke: #00f08a; stroke-width: 1.5; stroke-linecap: round; }

.coverage { display: grid; grid-template-columns: max-content 1fr max-content; column-gap: 12px; row-gap: 6px;
  align-items: end; font-size: 13px; font-variant-numeric: tabular-nums; }
.coverage svg { height: 34px; overflow: visible; border-bottom: 1px solid var(--rule); }
.area { fill: #cfe3ea; }
.line { fill: none; stroke: var(--accent); stroke-width: 1.2;
  vector-effect: non-scaling-stroke; stroke-linejoin: round; }
.ticks { position: relative; height: 1.4em; color: var(--soft); }
.ticks span { position: absolute; transform: translateX(-50%); }
.axis { text-align: center; color: var(--soft); }

@media (max-width: 700px) {
  header, main { padding-left: 12px; padding-right: 12px; }
  section { padding: 14px 12px 16px; }
  .measures, .measures tbody { display: block; }
  .measures thead { display: none; }
  .measures tr { display: grid; grid-template-columns: 1fr max-content max-content max-content; gap: 0 8px;
    padding: 8px 0; border-top: 1px solid var(--rule); }
  .measures th, .measures td { padding: 0; border: 0; }
  .measures td:last-child { grid-column: 1 / -1; color: var(--soft); font-size: 13.5px; }
  .views { gap: 16px 0; }
  .view { width: calc(100% * var(--share)); }
}
@media print {
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  body { background: #fff; font-size: 10.5pt; }
  header, main { max-width: none; padding-left: 0; padding-right: 0; }
  section { padding: 0 0 8px; border: 0; }
  #viewer { display: none; }
  .frames { grid-template-columns: repeat(4, 1fr); gap: 10px; }
  figure, tr, .coverage { break-inside: avoid; }
  h2 { break-after: avoid; }
}
"""
