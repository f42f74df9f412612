const EVERY = "";
const LOADS = "design loads", GAPS = "differences";

// ---- tables with rows that open ------------------------------------------------------------------
function sortable(table, columns, state, redraw) {
  const line = element("tr");
  for (const column of columns) {
    const cell = element("th");
    const button = element("button");
    button.type = "button";
    button.append(element("span", column.label, "label"));
    if (state.key === column.key) button.append(element("span", state.down ? "\u00a0▾" : "\u00a0▴", "arrow"));
    button.append(element("span", column.unit || "\u00a0", "unit"));
    explain(button, column.about);
    button.addEventListener("click", () => {
      state.down = state.key === column.key ? !state.down : column.down === true;
      state.key = column.key;
      redraw();
      table.querySelector(`th[data-key="${CSS.escape(column.key)}"] button`).focus({ preventScroll: true });
    });
    if (state.key === column.key) cell.setAttribute("aria-sort", state.down ? "descending" : "ascending");
    cell.dataset.key = column.key;
    cell.scope = "col";
    cell.append(button);
    line.append(cell);
  }
  table.tHead.replaceChildren(line);
}
function inOrder(rows, value, down) {
  // missing values last, in either direction; equal ones keep the order of the channels
  return [...rows].sort((a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === null || x === undefined) return y === null || y === undefined ? 0 : 1;
    if (y === null || y === undefined) return -1;
    const sign = typeof x === "string" ? x.localeCompare(y) : x - y;
    return down ? -sign : sign;
  });
}
function matches(text, wanted) {
  // every word of the filter, in either case
  return wanted.toLowerCase().split(/[\s,]+/).every((word) => text.includes(word));
}
function openable(line, columns, details) {
  // a click or the Enter key opens and closes the row below
  line.className = "row";
  line.tabIndex = 0;
  line.setAttribute("aria-expanded", "false");
  const toggle = () => {
    const below = line.nextElementSibling;
    const open = below && below.classList.contains("details");
    line.setAttribute("aria-expanded", String(!open));
    if (open) { below.remove(); return; }
    const row = element("tr", undefined, "details");
    const cell = element("td");
    cell.colSpan = columns;
    cell.append(...details());
    row.append(cell);
    line.after(row);
  };
  line.addEventListener("click", toggle);
  line.addEventListener("keydown", (event) => { if (event.key === "Enter") toggle(); });
}
function channelCell(row) {
  const cell = element("td", row.name);
  cell.append(element("span", row.unit, "range"));
  if (row.absent) cell.append(element("span", `not for design: ${row.absent}`, "mark"));
  if (row.about) cell.title = row.about;
  return cell;
}
const signed = (value) => (value === null ? "–" : `${value > 0 ? "+" : ""}${figure(value)}`);
const range = (low, high) => (low === null || low === undefined ? null : element("span", `${figure(low)} … ${figure(high)}`, "range"));
const decided = (low, high, centre) => low !== null && low !== undefined && (low > centre || high < centre);

// ---- ultimate loads ------------------------------------------------------------------------------
const ultimate = { key: "order", down: false };
function drawUltimate() {
  const wanted = $("ultimate-filter").value, group = $("ultimate-group").value, gaps = $("ultimate-view").value === GAPS;
  const columns = [
    { key: "order", label: "channel", about: "Click to sort in the order of the parts." },
    { key: "side", label: "side", about: "Largest or least value." },
    ...DATA.controllers.map((label, i) => ({ key: String(i), label, unit: gaps && label !== DATA.baseline ? `minus ${DATA.baseline}` : "design load", down: true,
      about: gaps ? "Difference of the design loads, paired in the seeds." : "Characteristic load times partial factor; below: 95 % interval and the condition that drives it." })),
    { key: "dlc", label: "load case", unit: DATA.controllers.length > 1 ? DATA.baseline : "", about: "The design load case that drives the load." },
  ];
  const here = DATA.ultimate.filter((row) => (!group || row.group === group) && matches(row.words, wanted));
  const base = DATA.controllers.indexOf(DATA.baseline);
  const values = { order: (row) => row.order, side: (row) => row.side, dlc: (row) => row.cells[base] && row.cells[base].dlc };
  const value = values[ultimate.key] || ((row) => {
    const cell = row.cells[Number(ultimate.key)];
    return cell && (gaps && Number(ultimate.key) !== base ? cell.gap : Math.abs(cell.load));
  });
  hideTip();
  sortable($("ultimate-table"), columns, ultimate, drawUltimate);
  $("ultimate-table").tBodies[0].replaceChildren(...inOrder(here, value, ultimate.down).map((row) => {
    const line = element("tr");
    line.append(channelCell(row), element("td", row.side));
    row.cells.forEach((cell, i) => {
      const place = element("td");
      if (!cell) { place.textContent = "–"; line.append(place); return; }
      if (gaps && i !== base) {
        const sure = decided(cell.gap_low, cell.gap_high, 0);
        place.append(element("span", signed(cell.gap), sure ? "best" : ""));
        const other = row.cells[base];
        if (other && other.load) place.append(element("span", percentage(100 * (cell.load / other.load - 1)), "gap"));
        const ends = range(cell.gap_low, cell.gap_high);
        if (ends) place.append(ends);
      } else {
        place.append(element("span", figure(cell.load)));
        const ends = range(cell.low, cell.high);
        if (ends) place.append(ends);
        place.append(element("span", `DLC ${cell.dlc}`, "range"));
      }
      line.append(place);
    });
    line.append(element("td", row.cells[base] ? row.cells[base].dlc : "–"));
    openable(line, columns.length, () => row.cells.flatMap((cell, i) => (cell ? ultimateDetails(cell, DATA.controllers[i], row) : [])));
    return line;
  }));
  $("ultimate-remark").textContent = `${here.length} of ${DATA.ultimate.length} rows.${gaps ? " Bold: the interval does not contain zero." : ""}`;
}
function ultimateDetails(cell, controller, row) {
  const where = cell.rule === "extrapolated" ? "most exceedances in" : "driven by";
  const text = `${controller}: ${figure(cell.value)} ${row.unit} (${DATA.rules[cell.rule] || cell.rule}) × ${cell.factor} = ${figure(cell.load)} ${row.unit}, ${where} `
    + `DLC ${cell.dlc}, ${cell.name}; closest run: seed ${cell.seed} at ${cell.time.toFixed(1)} s; largest of one run ${figure(cell.largest)} ${row.unit}.`;
  const list = element("ul");
  list.append(...cell.at.map(([name, unit, value]) => element("li", `${name} ${figure(value)} ${unit}`)));
  return cell.at.length ? [element("p", text), list] : [element("p", text)];
}

// ---- fatigue -------------------------------------------------------------------------------------
const fatigue = { key: "order", down: false };
function drawFatigue() {
  const wanted = $("fatigue-filter").value, group = $("fatigue-group").value, exponent = Number($("fatigue-exponent").value);
  const base = DATA.controllers.indexOf(DATA.baseline);
  const columns = [
    { key: "order", label: "channel", about: "Click to sort in the order of the parts." },
    ...DATA.controllers.map((label, i) => ({ key: String(i), label, unit: `m = ${exponent}`, down: true,
      about: i === base ? "Lifetime damage-equivalent load." : `Lifetime damage-equivalent load, and its ratio to ${DATA.baseline}.` })),
  ];
  const here = DATA.fatigue.filter((row) => row.m === exponent && (!group || row.group === group) && matches(row.words, wanted));
  const value = fatigue.key === "order" ? (row) => row.order : (row) => row.cells[Number(fatigue.key)] && row.cells[Number(fatigue.key)].load;
  hideTip();
  sortable($("fatigue-table"), columns, fatigue, drawFatigue);
  $("fatigue-table").tBodies[0].replaceChildren(...inOrder(here, value, fatigue.down).map((row) => {
    const line = element("tr");
    line.append(channelCell(row));
    row.cells.forEach((cell, i) => {
      const place = element("td");
      if (!cell) { place.textContent = "–"; line.append(place); return; }
      place.append(element("span", figure(cell.load)));
      const ends = range(cell.low, cell.high);
      if (ends) place.append(ends);
      if (i !== base && cell.ratio !== null) {
        const sure = decided(cell.ratio_low, cell.ratio_high, 1);
        const kind = sure ? (cell.ratio < 1 ? "gap better sure" : "gap worse sure") : "gap";
        const spread = cell.ratio_low === null ? "" : ` (${percentage(100 * (cell.ratio_low - 1))} … ${percentage(100 * (cell.ratio_high - 1))})`;
        place.append(element("span", `${percentage(100 * (cell.ratio - 1))}${spread}${sure ? (cell.ratio < 1 ? " ✓" : " ✗") : ""}`, kind));
      }
      line.append(place);
    });
    openable(line, columns.length, () => row.cells.flatMap((cell, i) => (cell ? [element("p", `${DATA.controllers[i]}: damage by DLC ${cell.share.map(([dlc, part]) => `${dlc} ${(100 * part).toFixed(1)} %`).join(", ")}`)] : [])));
    return line;
  }));
  $("fatigue-remark").textContent = `${here.length} channels${DATA.controllers.length > 1 ? `; ✓ less and ✗ more than ${DATA.baseline}, where the interval does not contain ±0 %` : ""}.`;
}

// ---- constraints ---------------------------------------------------------------------------------
function drawConstraints() {
  const head = element("tr");
  head.append(element("th", "constraint"), ...DATA.controllers.map((label) => element("th", label)), element("th", "limit"));
  $("constraint-table").tHead.replaceChildren(head);
  $("constraint-table").tBodies[0].replaceChildren(...DATA.constraints.map((row) => {
    const line = element("tr");
    const name = element("td", row.name);
    name.append(element("span", row.unit, "range"));
    line.append(name);
    for (const cell of row.cells) {
      const place = element("td");
      if (!cell) { place.textContent = "–"; line.append(place); continue; }
      place.append(element("span", `${figure(cell.value)}${cell.exceeded ? " ✗" : row.limit === null ? "" : " ✓"}`, cell.exceeded ? "bad" : ""));
      place.append(element("span", `DLC ${cell.dlc}, seed ${cell.seed}, ${cell.time.toFixed(0)} s`, "range"));
      if (row.limit !== null) place.append(element("span", `exceeded in ${cell.count} of ${cell.runs} runs`, "range"));
      place.title = cell.name;
      line.append(place);
    }
    line.append(element("td", row.limit === null ? "none" : `${row.least ? "≥" : "≤"} ${row.limit}`));
    return line;
  }));
}

// ---- extrapolation -------------------------------------------------------------------------------
function drawExtrapolation() {
  if (!DATA.extrapolation.length) return;
  const chosen = DATA.extrapolation[Number($("extrapolation-what").value)];
  const traces = [];
  chosen.cells.forEach((cell, i) => {
    if (!cell || !cell.curve.length) return;
    const label = plain(DATA.controllers[i]);
    traces.push({ type: "scatter", mode: "lines", name: label, x: cell.curve.map((point) => point[0]), y: cell.curve.map((point) => point[1]), line: { width: 2, color: colour(i) },
      hovertemplate: `${label}: %{x:.5g} ${plain(chosen.unit)}, %{y:.3g} per year<extra></extra>` });
    if (cell.low !== null) traces.push({ type: "scatter", mode: "lines", showlegend: false, x: [cell.low, cell.high], y: [1 / DATA.return_years, 1 / DATA.return_years], line: { width: 6, color: colour(i) }, opacity: 0.35,
      hovertemplate: `${label}: 95 % interval ${figure(cell.low)} … ${figure(cell.high)}<extra></extra>` });
    traces.push({ type: "scatter", mode: "markers", showlegend: false, x: [cell.value], y: [1 / DATA.return_years], marker: { size: 9, color: colour(i) }, hovertemplate: `${label}: ${figure(cell.value)}<extra></extra>` });
    traces.push({ type: "scatter", mode: "markers", showlegend: false, x: [cell.block], y: [1 / DATA.return_years], marker: { size: 10, symbol: "x-thin", line: { width: 2, color: colour(i) } }, hovertemplate: `${label}, block maxima: ${figure(cell.block)}<extra></extra>` });
  });
  draw("extrapolation-plot", traces, {
    height: 380, xaxis: { title: { text: plain(`${chosen.name} (${chosen.unit}), ${chosen.side}`) } },
    yaxis: { type: "log", exponentformat: "power", title: { text: "hours per year beyond it" }, range: [Math.log10(0.3 / DATA.return_years), 4] },
    shapes: [{ type: "line", xref: "paper", x0: 0, x1: 1, yref: "y", y0: 1 / DATA.return_years, y1: 1 / DATA.return_years, line: { width: 1, dash: "dot", color: css("--soft") } }],
  });
  const head = element("tr");
  head.append(...["controller", `once in ${DATA.return_years} years`, "95 % interval", "block maxima", "inverse FORM", "largest simulated", "most exceedances in"].map((text) => element("th", text)));
  $("extrapolation-table").tHead.replaceChildren(head);
  $("extrapolation-table").tBodies[0].replaceChildren(...chosen.cells.flatMap((cell, i) => {
    if (!cell) return [];
    const line = element("tr");
    const ends = cell.low === null ? "–" : `${figure(cell.low)} … ${figure(cell.high)}`;
    const form = cell.form.length && cell.form[0] !== null ? `${figure(cell.form[0])} (${figure(cell.form[1])} m/s, Hs ${figure(cell.form[2])} m)` : "–";
    line.append(...[DATA.controllers[i], figure(cell.value), ends, figure(cell.block), form, figure(cell.largest), cell.governing].map((text) => element("td", text)));
    return [line];
  }));
}

// ---- the page ------------------------------------------------------------------------------------
function drawAll() {
  drawUltimate(); drawFatigue(); drawConstraints(); drawExtrapolation();
}
for (const name of ["ultimate", "fatigue"]) {
  fill($(`${name}-group`), [EVERY, ...new Set(DATA[name].map((row) => row.group))], ["all", ...new Set(DATA[name].map((row) => row.group))]);
}
fill($("ultimate-view"), DATA.controllers.length > 1 ? [LOADS, GAPS] : [LOADS]);
$("ultimate-view").parentElement.hidden = DATA.controllers.length < 2;
fill($("fatigue-exponent"), DATA.exponents);
if (DATA.extrapolation.length) {
  fill($("extrapolation-what"), DATA.extrapolation.map((_, i) => i), DATA.extrapolation.map((row) => `${row.name}, ${row.side}`));
  $("extrapolation-what").addEventListener("change", drawExtrapolation);
}
followTheme();
for (const name of ["ultimate-filter", "fatigue-filter"]) $(name).addEventListener("input", name.startsWith("u") ? drawUltimate : drawFatigue);
for (const name of ["ultimate-group", "ultimate-view"]) $(name).addEventListener("change", drawUltimate);
for (const name of ["fatigue-group", "fatigue-exponent"]) $(name).addEventListener("change", drawFatigue);
drawAll();
