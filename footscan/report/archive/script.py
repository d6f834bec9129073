"""The script that filters and sorts the table of an archive: plain JavaScript, without library."""

SCRIPT = """\
(() => {
  "use strict";
  const table = document.getElementById("scans"), bodies = [...table.tBodies];
  const rows = bodies.flatMap(body => [...body.rows].map(row => ({row, body, words: row.textContent.toLowerCase()})));
  const [search, side, status, pairs] = ["search", "side", "status", "pairs"].map(id => document.getElementById(id));
  const numeric = new Set(["length", "quality"]);
  let sorted = rows;

  function filter() {
    const wanted = search.value.toLowerCase().split(" ").filter(word => word !== "");
    let shown = 0;
    for (const {row, words} of rows) {
      const ended = ["done", "finding"].includes(row.dataset.status) ? row.dataset.status : "failed";
      const fits = wanted.every(word => words.includes(word)) && (side.value === "" || side.value === row.dataset.side)
        && (status.value === "" || status.value === ended);
      row.hidden = !fits;
      shown += fits;
    }
    for (const body of bodies) body.hidden = [...body.rows].every(row => row.hidden);
    document.getElementById("count").textContent = `${shown} of ${rows.length} shown`;
  }

  // In the list all rows stand in one group; side by side each stands in that of its patient.
  function arrange() {
    table.classList.toggle("pairs", pairs.checked);
    for (const {row, body} of sorted) (pairs.checked ? body : bodies[0]).append(row);
    if (pairs.checked) for (const body of new Set(sorted.map(one => one.body))) table.append(body);
    filter();
  }

  function sort(head, key) {
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const sign = down ? -1 : 1;
    // What a scan does not have stands last, whichever way.
    sorted = [...rows].sort((a, b) => {
      const [one, other] = [a.row.dataset[key], b.row.dataset[key]];
      if (one === "" || other === "") return (one === "") - (other === "");
      return sign * (numeric.has(key) ? one - other : one < other ? -1 : Number(one > other));
    });
    arrange();
  }

  table.tHead.addEventListener("click", event => {
    const button = event.target.closest("[data-sort]");
    if (button) sort(button.closest("th"), button.dataset.sort);
  });
  for (const choice of [search, side, status]) choice.addEventListener("input", filter);
  pairs.addEventListener("change", arrange);
  document.querySelector(".filters").addEventListener("submit", event => event.preventDefault());
  document.querySelector(".filters").hidden = false;
  if (rows.length > 0) arrange();
})();
"""
