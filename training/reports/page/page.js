const ALL = "";
const narrow = () => !paper && $("pareto-plot").clientWidth < 560;

function decode(packed) {
  // 16-bit steps between low and high; the lowest code stands for a missing value
  const bytes = Uint8Array.from(atob(DATA.pool[packed.codes]), (c) => c.charCodeAt(0));
  const codes = new Uint16Array(bytes.buffer);
  const step = (packed.high - packed.low) / 65534;
  return Array.from(codes, (code) => (code === 0 ? null : packed.low + (code - 1) * step));
}

// ---- leaderboard -------------------------------------------------------------------------------
const order = { key: DATA.sort, down: false };
const MEANS = "means", GAPS = "differences";

function gapOf(row, metric) {
  // {text, kind, tip} of a difference; better and worse are shown by a mark in addition to the colour
  const percent = row.percent && row.percent[metric.name];
  if (percent === null || percent === undefined) return null;
  const p = row.p[metric.name];
  const [tested, sure] = [p !== undefined, p !== undefined && p <= DATA.alpha];
  const way = Math.abs(percent) < 0.005 ? 0 : Math.sign(percent) * metric.better;
  const judged = way && !row.lost && (sure || !tested);
  const word = way > 0 ? "better" : "worse";
  const found = sure ? `significant, corrected p = ${p.toPrecision(2)}` : tested ? `not significant, corrected p = ${p.toPrecision(2)}` : "not tested";
  return {
    text: `${percentage(percent)}${sure ? " *" : ""}${judged ? (way > 0 ? " ✓" : " ✗") : ""}`,
    kind: `gap${judged ? ` ${word}` : ""}${sure ? " sure" : ""}`,
    tip: `${percentage(percent)} against ${DATA.baseline}: ${judged ? `${word}, ` : ""}${found}`,
  };
}

function shownColumns() {
  return DATA.metrics.filter((metric) => metric.headline || $("all-columns").checked);
}

function sortedRows() {
  const rows = [...DATA.board[$("table-case").value]];
  const shown = $("table-view").value === GAPS ? "percent" : "values";
  const own = { controller: (row) => row.controller, lost: (row) => row.lost, rank: (row) => row.rank };
  const value = own[order.key] || ((row) => (shown === "percent" && row.controller === DATA.baseline ? 0 : row[shown][order.key]));
  rows.sort((a, b) => {
    if (!own[order.key] && !a.lost !== !b.lost) return a.lost ? 1 : -1; // controllers with lost runs last: their means are over other runs
    const [x, y] = [value(a), value(b)];
    if (x === null || x === undefined) return 1; // missing values last, in either direction
    if (y === null || y === undefined) return -1;
    const sign = typeof x === "string" ? x.localeCompare(y) : x - y;
    return order.down ? -sign : sign;
  });
  return rows;
}

function headerCell(key, label, unit, about) {
  const cell = element("th");
  const button = element("button");
  button.append(element("span", label, "label"));
  if (order.key === key) button.append(element("span", order.down ? "\u00a0▾" : "\u00a0▴", "arrow"));
  button.append(element("span", unit || "\u00a0", "unit"));
  button.type = "button";
  explain(button, about);
  button.addEventListener("click", () => {
    order.down = order.key === key ? !order.down : false;
    order.key = key;
    drawTable();
    $("table").querySelector(`th[data-key="${CSS.escape(key)}"] button`).focus({ preventScroll: true });
  });
  if (order.key === key) cell.setAttribute("aria-sort", order.down ? "descending" : "ascending");
  cell.dataset.key = key;
  cell.scope = "col";
  cell.append(button);
  return cell;
}

function bestOf(metric, rows) {
  const values = rows.filter((row) => !row.lost).map((row) => row.values[metric.name]).filter((value) => value !== null && value !== undefined);
  if (!metric.better || values.length < 2) return null;
  return metric.better > 0 ? Math.max(...values) : Math.min(...values);
}

function figureCell(row, metric, best) {
  const cell = element("td");
  const value = row.values[metric.name];
  const gap = row.percent ? gapOf(row, metric) : null;
  const intervals = $("intervals").checked;
  const gaps = $("table-view").value === GAPS;
  const range = intervals && (gaps ? row.gap_intervals : row.intervals || {})[metric.name];
  if (gaps && row.controller === DATA.baseline) cell.append(element("span", "baseline", "gap"));
  else if (gaps) {
    cell.append(gap ? element("span", gap.text, gap.kind) : element("span", "–", "gap"));
    const absolute = row.gaps[metric.name];
    if (absolute !== null && absolute !== undefined) cell.append(element("span", `${absolute > 0 ? "+" : ""}${figure(absolute)}`, "range"));
  } else {
    cell.append(element("span", figure(value), !row.lost && value !== null && value !== undefined && value === best ? "best" : ""));
    if (gap) cell.append(element("span", gap.text, gap.kind));
  }
  if (gap) cell.title = gap.tip;
  if (range) cell.append(element("span", `${figure(range[0])} … ${figure(range[1])}`, "range"));
  return cell;
}

function drawTable() {
  const columns = shownColumns();
  const rows = sortedRows();
  const head = element("tr");
  head.append(headerCell("controller", "controller", "", "Click to sort by name."), headerCell("lost", "lost", "runs", "Runs that failed, tripped or lost power (less than half of the reference's energy), of all runs. Lost runs are not in these means; a score counts them as far worse than the reference."));
  if (DATA.ranked) head.append(headerCell("rank", "rank", "", "First controllers that exceed no limit and lost no run, then those that exceed a limit, then those with lost runs; within each group by score, else in order of evaluation. A limit is held only if the bound of its interval is within it, too; else it is not decided."));
  for (const metric of columns) head.append(headerCell(metric.name, metric.label, metric.unit, metric.about));
  hideTip();
  $("table").classList.toggle("every", $("all-columns").checked);
  $("table").tHead.replaceChildren(head);
  const best = Object.fromEntries(columns.map((metric) => [metric.name, bestOf(metric, rows)]));
  $("table").tBodies[0].replaceChildren(...rows.map((row) => {
    const line = element("tr");
    const name = element("td");
    const swatch = element("span", undefined, "swatch");
    swatch.style.background = colour(DATA.numbers[DATA.controllers.indexOf(row.controller)]);
    name.append(swatch, row.controller);
    const lost = element("td", `${row.lost} of ${row.runs}`);
    if (row.lost) {
      lost.className = "bad";
      lost.append(element("span", row.lost_text, "range bad"));
    }
    line.append(name, lost);
    if (row.held) name.append(element("span", "✓ limits held", "range"));
    if (row.beyond && row.beyond.length) name.append(element("span", `beyond a limit: ${row.beyond.join("; ")}`, "range bad"));
    if (row.undecided && row.undecided.length) name.append(element("span", `not decided: ${row.undecided.join("; ")}`, "range"));
    if (DATA.ranked) line.append(element("td", row.rank));
    for (const metric of columns) line.append(figureCell(row, metric, best[metric.name]));
    return line;
  }));
  if (!rows.length) $("table").tBodies[0].append(element("tr"));
  $("table-remark").textContent = DATA.remarks[$("table-case").value];
  const legend = [];
  if (DATA.baseline !== null && rows.some((row) => Object.values(row.percent || {}).some((value) => value !== null))) {
    legend.push(element("span", `Percentages: against ${DATA.baseline}.`), element("span", "✓ better", "better"), element("span", "✗ worse", "worse"));
    if (rows.some((row) => Object.values(row.p).length)) legend.push(element("span", `* significant (p ≤ ${Number(DATA.alpha.toPrecision(2))})`));
  }
  $("table-legend").replaceChildren(...legend);
}

// ---- case by case ------------------------------------------------------------------------------
function drawWinds() {
  const metric = DATA.metrics.find((each) => each.name === $("wind-what").value);
  const rowOf = (controller, name) => DATA.board[name].find((each) => each.controller === controller);
  const cell = (tag, text, lower, kind) => {
    const made = element(tag, text);
    if (lower !== undefined) made.append(element("span", lower, kind));
    return made;
  };
  const share = (name) => (DATA.shares && DATA.shares[name] !== undefined ? `${(100 * DATA.shares[name]).toFixed(1)} % of time` : "\u00a0");
  const head = element("tr");
  const first = cell("th", "controller", metric.unit, "unit");
  head.append(first, cell("th", "all cases", "lifetime mean", "unit"), ...DATA.cases.map((name) => {
    const made = cell("th", undefined, share(name), "unit");
    made.prepend(explain(element("span", name), DATA.conditions[name]));
    return made;
  }));
  $("wind-table").tHead.replaceChildren(head);
  $("wind-table").tBodies[0].replaceChildren(...DATA.board[ALL].map(({ controller }) => {
    const line = element("tr");
    line.append(cell("td", controller), ...[ALL, ...DATA.cases].map((name) => {
      const row = rowOf(controller, name);
      const gap = row && row.percent ? gapOf(row, metric) : null;
      return cell("td", figure(row ? row.values[metric.name] : null), gap ? gap.text : "\u00a0", gap ? gap.kind : "gap");
    }));
    return line;
  }));
  const against = DATA.baseline === null ? "" : ` Below: the difference from ${DATA.baseline}; differences of single cases are not tested for significance.`;
  $("wind-remark").textContent = `${metric.about} Means over the seeds of each case.${against}`;
}

// ---- Pareto ------------------------------------------------------------------------------------
const PLACES = ["top center", "bottom center", "middle right", "middle left", "top right", "bottom right", "top left", "bottom left"];

function placeLabels(marks, width, height) {
  // for each mark {x, y, r, text}, in pixels: the label position with the least overlap
  const taken = marks.map(({ x, y, r }) => [x - r, y - r, x + r, y + r]);
  const overlap = (a, b) => Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));
  return marks.map(({ x, y, r, text }) => {
    const [w, h] = [7.2 * text.length + 4, 16];
    const boxes = PLACES.map((place) => {
      const [down, side] = place.split(" ");
      const left = side === "center" ? x - w / 2 : side === "right" ? x + (down === "middle" ? r : 0.7 * r) + 2 : x - w - (down === "middle" ? r : 0.7 * r) - 2;
      const top = down === "middle" ? y - h / 2 : down === "top" ? y - h - (side === "center" ? r : 0.7 * r) - 1 : y + (side === "center" ? r : 0.7 * r) + 1;
      return [left, top, left + w, top + h];
    });
    const outside = (box) => Math.max(0, -box[0]) + Math.max(0, box[2] - width) + Math.max(0, -box[1]) + Math.max(0, box[3] - height);
    const cost = boxes.map((box) => taken.reduce((sum, other) => sum + overlap(box, other), 0) + 40 * outside(box));
    const best = cost.indexOf(Math.min(...cost));
    taken.push(boxes[best]);
    return PLACES[best];
  });
}

function drawPareto() {
  const [across, up, size] = DATA.pareto;
  const known = (value) => value !== null && value !== undefined;
  const every = DATA.board[$("table-case").value].filter((row) => known(row.values[across]) && known(row.values[up]));
  const whole = every.filter((row) => !row.lost); // controllers with lost runs are excluded from front and scale
  const range = (key) => {
    const values = (whole.length ? whole : every).map((row) => row.values[key]);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    if (!values.length) return [0, 1];
    const pad = 0.22 * (high - low) || 0.2 * Math.abs(high) || 1;
    return [Math.max(0, low - pad), high + pad];
  };
  const [xs, ys] = [range(across), range(up)];
  const inside = (value, ends) => value >= ends[0] && value <= ends[1];
  const rows = every.filter((row) => inside(row.values[across], xs) && inside(row.values[up], ys));
  const off = every.filter((row) => !rows.includes(row)).map((row) => row.controller);
  const most = Math.max(1e-12, ...rows.map((row) => row.values[size] || 0));
  const radius = (row) => Math.max(2.5, (narrow() ? 13 : 19) * Math.sqrt(Math.max(0, row.values[size] || 0) / most));
  const [width, height] = [(paper ? 680 : $("pareto-plot").clientWidth) - 80, 430 - 64];
  const places = placeLabels(rows.map((row) => ({
    x: (width * (row.values[across] - xs[0])) / (xs[1] - xs[0]), y: height * (1 - (row.values[up] - ys[0]) / (ys[1] - ys[0])), r: radius(row), text: row.controller,
  })), width, height);
  const line = (row, key, name, unit) => {
    const range = row.intervals && row.intervals[key];
    return `${name} ${figure(row.values[key])}${range ? ` [${figure(range[0])}, ${figure(range[1])}]` : ""} ${unit}<br>`;
  };
  const traces = rows.map((row, i) => ({
    type: "scatter", mode: "markers+text", name: plain(row.controller), text: [plain(row.controller)], textposition: places[i],
    x: [row.values[across]], y: [row.values[up]], textfont: { size: 13 }, showlegend: false, cliponaxis: false,
    marker: {
      color: colour(DATA.numbers[DATA.controllers.indexOf(row.controller)]), opacity: 0.8, symbol: row.lost ? "circle-open" : "circle",
      line: row.lost ? { width: 2 } : { color: css("--card"), width: 1 },
      size: [2 * radius(row)],
    },
    hovertemplate: `<b>${plain(row.controller)}</b><br>${line(row, across, "rotor-speed std", "rpm")}${line(row, up, "platform-pitch std", "deg")}`
      + `pitch travel ${figure(row.values[size])} deg/s<extra></extra>`,
  }));
  const front = whole.filter((a) => !whole.some((b) => b !== a && b.values[across] <= a.values[across] && b.values[up] <= a.values[up]
    && (b.values[across] < a.values[across] || b.values[up] < a.values[up])));
  front.sort((a, b) => a.values[across] - b.values[across]);
  if (front.length > 1) {
    const points = { x: front.map((row) => row.values[across]), y: front.map((row) => row.values[up]) };
    traces.unshift({ type: "scatter", mode: "lines", name: "Pareto front", ...points, hoverinfo: "skip", showlegend: false, line: { dash: "dot", shape: "hv", width: 1.5, color: css("--soft") } });
  }
  const where = $("table-case").value === ALL ? "lifetime means over all cases" : `means of ${$("table-case").value}`;
  const names = front.map((row) => row.controller).join(", ");
  const found = front.length > 1 ? ` No controller lies below and to the left of the dotted line (${names}).`
    : rows.length > 1 && front.length ? ` ${names} is least in both.` : "";
  $("pareto-remark").textContent = rows.length
    ? `Less is better on both axes: ${where}, for the case chosen in the leaderboard. The area of a mark is the pitch travel${rows.length > whole.length ? "; hollow: controllers with lost runs, over the others" : ""}.${off.length ? ` ${off.length} off scale: ${off.join(", ")}.` : ""}${found} Intervals are shown on hover; the leaderboard shows which differences are significant.`
    : "No controller has both standard deviations here.";
  draw("pareto-plot", traces, {
    height: 430, xaxis: { title: { text: "rotor speed, standard deviation (rpm)" }, range: xs },
    yaxis: { title: { text: "platform pitch, standard deviation (deg)" }, range: ys },
  });
}

// ---- boxes -------------------------------------------------------------------------------------
function drawBoxes() {
  const [kind, name] = JSON.parse($("box-what").value);
  const traces = DATA.controllers.map((controller, i) => {
    const look = { type: "box", name: plain(controller), marker: { color: colour(DATA.numbers[i]), size: 4 }, line: { width: 1.5 }, offsetgroup: String(i) };
    if (kind === "metric") {
      const place = DATA.columns.indexOf(name);
      const points = DATA.runs.filter((run) => run[0] === controller && run[3][place] !== null);
      return {
        ...look, x: points.map((run) => plain(run[1])), y: points.map((run) => run[3][place]), boxpoints: "all", jitter: 0.35, pointpos: 0,
        text: points.map((run) => `seed ${run[2]}`),
      };
    }
    const boxes = (DATA.quantiles[name] || {})[controller] || [];
    const column = (k) => boxes.map((box) => box[k]);
    return { ...look, x: boxes.map((box) => plain(box[0])), lowerfence: column(1), q1: column(2), median: column(3), q3: column(4), upperfence: column(5) };
  });
  $("box-remark").textContent = kind === "metric"
    ? "One point per run that ended well; the box spans the quartiles over the seeds."
    : "All samples of the scored part of each case, its seeds pooled: quartiles, whiskers from the 1st to the 99th percentile.";
  draw("box-plot", traces, {
    height: 410, boxmode: "group", margin: { l: 64, r: 16, t: 16, b: 30 }, xaxis: { type: "category", categoryorder: "array", categoryarray: DATA.cases.map(plain) },
    yaxis: { title: { text: plain(DATA.titles[name]) } },
  });
}

// ---- time series and spectra -------------------------------------------------------------------
const chosen = () => (DATA.series[$("series-case").value] || {})[$("series-seed").value] || {};

function panels(entries, field, axes) {
  // {traces, layout} of stacked panels; a channel that is the same for all controllers is drawn once
  const shape = {};
  const traces = [];
  const gap = 0.02;
  const height = (1 - gap * (axes.length - 1)) / axes.length;
  const named = new Set();
  const lost = lostRuns();
  const annotations = [];
  axes.forEach((axis, number) => {
    const suffix = number ? String(number + 1) : "";
    const top = 1 - number * (height + gap);
    const held = DATA.controllers.map((controller, i) => [controller, i, entries[controller]]).filter(([, , run]) => run && run[field][axis.channel]);
    const same = held.length > 1 && held.every(([, , run]) => ["codes", "low", "high"].every((key) => run[field][axis.channel][key] === held[0][2][field][axis.channel][key]));
    const sound = held.filter(([controller]) => !lost[controller]); // lost runs are excluded from the scale
    const ends = (sound.length ? sound : held).map(([, , run]) => run[field][axis.channel]);
    const [least, most] = [Math.min(...ends.map((packed) => packed.low)), Math.max(...ends.map((packed) => packed.high))];
    const pad = 0.06 * (most - least) || 1;
    const off = axis.power ? [] : held.filter(([, , run]) => run[field][axis.channel].low < least - pad || run[field][axis.channel].high > most + pad);
    if (off.length) {
      annotations.push({ xref: "paper", yref: `y${suffix} domain`, x: 1, y: 1, xanchor: "right", yanchor: "top", showarrow: false,
        text: plain(`${off.length} off scale: ${off.map(([controller]) => controller).join(", ")}`), font: { size: 10, color: css("--soft") } });
    }
    for (const [controller, i, run] of same ? held.slice(0, 1) : held) {
      const packed = run[field][axis.channel];
      const y = decode(packed);
      const label = `${plain(controller)}${lost[controller] ? " (lost)" : ""}`;
      traces.push({
        type: "scatter", mode: "lines", xaxis: "x", yaxis: `y${suffix}`,
        x: y.map((_, k) => packed.start + k * packed.step), y: axis.power ? y.map((v) => (v === null ? null : 10 ** v)) : y,
        name: same ? "all controllers" : label, legendgroup: same ? "all" : String(i), showlegend: !named.has(same ? "all" : i),
        line: { width: 1.2, color: same ? css("--soft") : colour(DATA.numbers[i]) }, hovertemplate: "%{y:.4g}",
      });
      named.add(same ? "all" : i);
      if (field === "series" && lost[controller] && !same && y.length) {
        const last = packed.start + (y.length - 1) * packed.step;
        traces.push({ type: "scatter", mode: "markers", x: [last], y: [y[y.length - 1]], xaxis: "x", yaxis: `y${suffix}`, showlegend: false, legendgroup: String(i),
          marker: { symbol: "x", size: 9, color: css("--bad") }, hovertemplate: `${plain(controller)}: ${plain(lost[controller])}<extra></extra>` });
      }
    }
    const axisOf = axis.power ? { range: [axis.low(most), most + 0.6] } : off.length ? { range: [least - pad, most + pad] } : {};
    shape[`yaxis${suffix}`] = { domain: [Math.max(0, top - height), top], title: { text: axis.label, font: { size: 11 }, standoff: 8 }, nticks: 5, ...axis.y, ...axisOf };
  });
  return { traces, shape, annotations };
}
const lostRuns = () => (DATA.lost[$("series-case").value] || {})[$("series-seed").value] || {};

function drawSeries() {
  const entries = chosen();
  const axes = DATA.panels.filter((panel) => Object.values(entries).some((run) => run.series[panel.channel]));
  const { traces, shape, annotations } = panels(entries, "series", axes);
  const skips = Object.values(entries).map((run) => run.skip).filter((skip) => skip > 0);
  const start = Math.min(...Object.values(entries).map((run) => run.start));
  const end = start + Math.max(0, ...skips);
  const about = DATA.conditions[$("series-case").value];
  $("series-about").textContent = `${$("series-case").value}: ${about}.${skips.length ? " Shaded: the start, which is not scored." : ""}`;
  $("series-lost").replaceChildren(...Object.entries(lostRuns()).map(([controller, text]) => element("li", `${controller}: ${text}`)));
  draw("series-plot", traces, {
    ...shape, annotations, height: 90 + 118 * Math.max(1, axes.length), hovermode: "x",
    xaxis: { title: { text: "time (s)" }, anchor: axes.length > 1 ? `y${axes.length}` : "y" },
    shapes: skips.length ? [{ type: "rect", xref: "x", yref: "paper", x0: start, x1: end, y0: 0, y1: 1, layer: "below", fillcolor: css("--shade"), opacity: 0.16, line: { width: 0 } }] : [],
  });
}

const DASHES = ["dash", "dot", "dashdot"];
function drawSpectra() {
  const entries = chosen();
  const low = (most) => most + Math.log10(DATA.span);
  const axes = DATA.spectra.filter((panel) => Object.values(entries).some((run) => run.spectra[panel.channel]))
    .map((panel) => ({ ...panel, power: true, low, y: { type: "log", exponentformat: "power", dtick: 2 } }));
  const { traces, shape } = panels(entries, "spectra", axes);
  const marks = [...((Object.values(entries).find((run) => run.marks.length) || {}).marks || [])].sort((a, b) => a[1] - b[1]);
  const height = 140 + 190 * Math.max(1, axes.length);
  $("spectra-about").textContent = axes.length
    ? `Power spectral density of ${$("series-case").value}, seed ${$("series-seed").value}, as selected above.${marks.length ? " Vertical lines: the frequencies named at the top." : ""}`
    : "No run shown has enough scored samples for a spectrum.";
  draw("spectra-plot", traces, {
    ...shape, height, hovermode: "x", margin: { l: 64, r: 16, t: narrow() ? 54 : 38, b: 48 },
    xaxis: { type: "log", title: { text: "frequency (Hz)", standoff: 8 }, range: [Math.log10(0.005), Math.log10(0.5)], tickvals: [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1], anchor: axes.length > 1 ? `y${axes.length}` : "y" },
    legend: { orientation: "h", yanchor: "top", y: -72 / (height - 100), x: 0 },
    shapes: marks.map((mark, i) => ({ type: "line", xref: "x", yref: "paper", x0: mark[1], x1: mark[1], y0: 0, y1: 1, line: { width: 1.2, dash: DASHES[i % 3], color: css("--soft") } })),
    annotations: marks.map((mark, i) => ({ xref: "x", yref: "paper", x: Math.log10(mark[1]), y: 1, yshift: 15 * (i % (narrow() ? 3 : 2)), yanchor: "bottom", showarrow: false, text: plain(mark[0]), font: { size: 11, color: css("--soft") } })),
  });
}

function drawSchedule() {
  if (!DATA.schedule) return;
  const shape = {};
  const across = narrow() ? 2 : 3;
  const down = Math.ceil(DATA.schedule.panels.length / across);
  const traces = DATA.schedule.panels.map((panel, i) => {
    const suffix = i ? String(i + 1) : "";
    const [column, row] = [i % across, Math.floor(i / across)];
    const [left, top] = [column / across + 0.04, 1 - row / down];
    shape[`xaxis${suffix}`] = { domain: [left, (column + 1) / across - 0.01], anchor: `y${suffix}`, title: row === down - 1 ? { text: "wind (m/s)", standoff: 6 } : undefined };
    shape[`yaxis${suffix}`] = { domain: [top - 1 / down + (row === down - 1 ? 0 : 0.09), top - 0.06], anchor: `x${suffix}` };
    return { type: "scatter", mode: "lines+markers", x: DATA.schedule.wind, y: panel.values, xaxis: `x${suffix}`, yaxis: `y${suffix}`, showlegend: false, line: { width: 2, color: colour(0) }, marker: { size: 4 }, hovertemplate: "%{x:g} m/s: %{y:.5g}<extra></extra>" };
  });
  const annotations = DATA.schedule.panels.map((panel, i) => ({
    xref: "paper", yref: "paper", x: (i % across) / across + 0.04, y: 1 - Math.floor(i / across) / down - 0.055, xanchor: "left", yanchor: "bottom", showarrow: false, text: `<b>${plain(panel.label)}</b>`, font: { size: narrow() ? 10 : 12 },
  }));
  draw("schedule-plot", traces, { ...shape, height: 200 * down + 40, annotations, margin: { l: 30, r: 10, t: 6, b: 44 } });
}

// ---- the page ----------------------------------------------------------------------------------
function chooseSeeds() {
  // all seeds of the case; seeds without series in the file are disabled
  const there = DATA.series[$("series-case").value] || {};
  const before = $("series-seed").value;
  const seeds = DATA.seeds[$("series-case").value];
  fill($("series-seed"), seeds, seeds.map((seed) => (there[seed] ? seed : `${seed} (not in this page)`)));
  for (const option of $("series-seed").options) option.disabled = !there[option.value];
  $("series-seed").value = there[before] ? before : seeds.find((seed) => there[seed]);
}
function drawAll() {
  drawTable(); drawWinds(); drawPareto(); drawBoxes(); drawSeries(); drawSpectra(); drawSchedule();
}
fill($("table-case"), [ALL, ...DATA.cases], ["all cases", ...DATA.cases]);
for (const [kind, title, names] of [["samples", "samples of a channel", Object.keys(DATA.quantiles)], ["metric", "metrics of the runs", DATA.metrics.map((m) => m.name).filter((name) => DATA.columns.includes(name))]]) {
  if (!names.length) continue;
  const group = document.createElement("optgroup");
  group.label = title;
  group.append(...names.map((name) => new Option(DATA.titles[name], JSON.stringify([kind, name]))));
  $("box-what").append(group);
}
const compared = DATA.metrics.filter((metric) => !metric.name.startsWith("score_"));
fill($("wind-what"), compared.map((metric) => metric.name), compared.map((metric) => DATA.titles[metric.name] || metric.label));
fill($("table-view"), DATA.baseline === null ? [MEANS] : [MEANS, GAPS], DATA.baseline === null ? undefined : ["means", `differences from ${DATA.baseline}`]);
$("table-view").parentElement.hidden = $("table-view").options.length < 2;
$("intervals").parentElement.hidden = !DATA.board[ALL].some((row) => row.intervals && Object.keys(row.intervals).length);
fill($("series-case"), Object.keys(DATA.series));
for (const section of ["series", "spectra"]) $(section).hidden = !Object.keys(DATA.series).length;
if (Object.keys(DATA.series).length) chooseSeeds();
followTheme();
$("table-case").addEventListener("change", () => { drawTable(); drawPareto(); });
$("table-view").addEventListener("change", drawTable);
$("intervals").addEventListener("change", drawTable);
$("all-columns").addEventListener("change", drawTable);
$("wind-what").addEventListener("change", drawWinds);
$("box-what").addEventListener("change", drawBoxes);
$("series-case").addEventListener("change", () => { chooseSeeds(); drawSeries(); drawSpectra(); });
$("series-seed").addEventListener("change", () => { drawSeries(); drawSpectra(); });
drawAll();
