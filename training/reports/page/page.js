"use strict";
const DATA = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const LIGHT = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#3F9BD8", "#7A52C7", "#7f7f7f", "#8C564B", "#17becf"];
const DARK = ["#4DA6E0", "#FF8B4A", "#35C99A", "#E79BC4", "#F0B93A", "#8CCBF5", "#B79BF5", "#b0b0b0", "#C49C94", "#5fe0ec"];
const ALL = "";
const dark = () => document.documentElement.dataset.theme === "dark";
const colour = (i) => (dark() ? DARK : LIGHT)[i % LIGHT.length];
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
// plotly reads some tags in its texts: names are shown as they are
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

function decode(packed) {
  // 16-bit steps between low and high; the lowest code stands for a missing value
  const bytes = Uint8Array.from(atob(packed.codes), (c) => c.charCodeAt(0));
  const codes = new Uint16Array(bytes.buffer);
  const step = (packed.high - packed.low) / 65534;
  return Array.from(codes, (code) => (code === 0 ? null : packed.low + (code - 1) * step));
}

function layout(more) {
  const axis = { gridcolor: css("--line"), linecolor: css("--line"), zerolinecolor: css("--line"), automargin: true };
  const base = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", hovermode: "closest",
    font: { color: css("--ink"), family: getComputedStyle(document.body).fontFamily, size: 12 },
    margin: { l: 64, r: 16, t: 16, b: 48 }, legend: { orientation: "h", yanchor: "bottom", y: 1.01, x: 0 },
    hoverlabel: { bgcolor: css("--card"), bordercolor: css("--line"), font: { color: css("--ink") } },
  };
  const merged = { ...base, ...more };
  for (const key of Object.keys(merged)) {
    if (/^[xy]axis/.test(key)) merged[key] = { ...axis, ...merged[key] };
  }
  return merged;
}
const CONFIG = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
const draw = (id, traces, shape) => Plotly.react($(id), traces, layout(shape), CONFIG);

function fill(select, values, texts) {
  select.replaceChildren(...values.map((value, i) => new Option((texts || values)[i], value)));
}

// ---- leaderboard -------------------------------------------------------------------------------
const order = { key: DATA.sort, down: false };

function figure(value) {
  if (value === null || value === undefined) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) return value.toExponential(2);
  return size >= 1000 ? value.toFixed(0) : value.toPrecision(size >= 100 ? 4 : 3);
}

function shownColumns() {
  return DATA.metrics.filter((metric) => metric.headline || $("all-columns").checked);
}

function sortedRows() {
  const rows = [...DATA.board[$("table-view").value][$("table-case").value]];
  const value = (row) => (order.key === "controller" ? row.controller : order.key === "failed" ? row.failed + row.tripped : order.key === "rank" ? row.rank : row.values[order.key]);
  rows.sort((a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === null || x === undefined) return 1; // missing figures last, whichever the direction
    if (y === null || y === undefined) return -1;
    const sign = typeof x === "string" ? x.localeCompare(y) : x - y;
    return order.down ? -sign : sign;
  });
  return rows;
}

function headerCell(key, label, unit, hint) {
  const cell = document.createElement("th");
  const button = document.createElement("button");
  const arrow = document.createElement("span");
  arrow.className = "arrow";
  arrow.textContent = order.key === key ? (order.down ? "▾" : "▴") : "";
  button.append(label, arrow);
  if (unit !== undefined) {
    const line = document.createElement("span");
    line.className = "unit";
    line.textContent = unit || "\u00a0";
    button.append(line);
  }
  button.type = "button";
  button.title = hint;
  button.addEventListener("click", () => {
    order.down = order.key === key ? !order.down : false;
    order.key = key;
    drawTable();
  });
  if (order.key === key) cell.setAttribute("aria-sort", order.down ? "descending" : "ascending");
  cell.dataset.key = key;
  cell.scope = "col";
  cell.append(button);
  return cell;
}

function bestOf(metric, rows) {
  const values = rows.map((row) => row.values[metric.name]).filter((value) => value !== null && value !== undefined);
  if (!metric.better || values.length < 2 || $("table-view").value !== "mean") return null;
  return metric.better > 0 ? Math.max(...values) : Math.min(...values);
}

function drawTable() {
  const columns = shownColumns();
  const rows = sortedRows();
  const head = document.createElement("tr");
  head.append(headerCell("controller", "controller", "", "sort by name"), headerCell("failed", "lost", "runs", "failed and tripped runs of all runs"));
  if (DATA.ranked) head.append(headerCell("rank", "rank", "", "runs lost and limits passed first, then the score"));
  for (const metric of columns) head.append(headerCell(metric.name, metric.label, metric.unit, metric.name));
  $("table").tHead.replaceChildren(head);
  const best = Object.fromEntries(columns.map((metric) => [metric.name, bestOf(metric, rows)]));
  $("table").tBodies[0].replaceChildren(...rows.map((row) => {
    const line = document.createElement("tr");
    const name = document.createElement("td");
    const swatch = document.createElement("span");
    swatch.className = "swatch";
    swatch.style.background = colour(DATA.controllers.indexOf(row.controller));
    name.append(swatch, row.controller);
    const failed = document.createElement("td");
    failed.textContent = `${row.failed + row.tripped} of ${row.runs}`;
    failed.title = `${row.failed} failed, ${row.tripped} tripped`;
    if (row.failed + row.tripped) failed.className = "bad";
    line.append(name, failed);
    if (row.beyond && row.beyond.length) {
      const text = document.createElement("span");
      text.className = "range bad";
      text.textContent = "beyond a limit";
      text.title = row.beyond.join("; ");
      name.append(text);
    }
    if (DATA.ranked) {
      const rank = document.createElement("td");
      rank.textContent = row.rank;
      line.append(rank);
    }
    for (const metric of columns) {
      const cell = document.createElement("td");
      const value = row.values[metric.name];
      cell.textContent = figure(value);
      if (value !== null && value !== undefined && value === best[metric.name]) cell.className = "best";
      const range = row.intervals && row.intervals[metric.name];
      if (range) {
        const text = document.createElement("span");
        text.className = "range";
        text.textContent = `${figure(range[0])} … ${figure(range[1])}`;
        cell.append(text);
      }
      line.append(cell);
    }
    return line;
  }));
  $("table-remark").textContent = DATA.remarks[$("table-case").value];
}

// ---- wind by wind ------------------------------------------------------------------------------
function drawWinds() {
  const metric = DATA.metrics.find((each) => each.name === $("wind-what").value);
  const value = (controller, name) => {
    const row = DATA.board.mean[name].find((each) => each.controller === controller);
    return row ? row.values[metric.name] : null;
  };
  const cell = (tag, text, lower) => {
    const made = document.createElement(tag);
    made.textContent = text;
    if (lower !== undefined) {
      const line = document.createElement("span");
      line.className = tag === "th" ? "unit" : "range";
      line.textContent = lower;
      made.append(line);
    }
    return made;
  };
  const share = (name) => (DATA.shares && DATA.shares[name] !== undefined ? `${(100 * DATA.shares[name]).toFixed(1)} %` : "\u00a0");
  const head = document.createElement("tr");
  const columns = [[ALL, "all", "lifetime"], ...DATA.cases.map((name) => [name, name, share(name)])];
  head.append(cell("th", "controller", metric.unit), ...columns.map(([, text, lower]) => cell("th", text, lower)));
  $("wind-table").tHead.replaceChildren(head);
  $("wind-table").tBodies[0].replaceChildren(...DATA.board.mean[ALL].map(({ controller }) => {
    const line = document.createElement("tr");
    line.append(cell("td", controller), ...columns.map(([name]) => {
      const [own, base] = [value(controller, name), DATA.baseline === null ? null : value(DATA.baseline, name)];
      const ratio = own != null && base && controller !== DATA.baseline ? (own / base).toFixed(3) : "\u00a0";
      return cell("td", figure(own), ratio);
    }));
    return line;
  }));
}

// ---- Pareto ------------------------------------------------------------------------------------
function drawPareto() {
  const [across, up, size] = DATA.pareto;
  const rows = DATA.board.mean[$("table-case").value].filter((row) => row.values[across] != null && row.values[up] != null);
  const most = Math.max(1e-12, ...rows.map((row) => row.values[size] || 0));
  const traces = rows.map((row) => ({
    type: "scatter", mode: "markers+text", name: plain(row.controller), text: [plain(row.controller)], textposition: "top center",
    x: [row.values[across]], y: [row.values[up]], textfont: { size: 13 }, showlegend: false, cliponaxis: false,
    marker: {
      color: colour(DATA.controllers.indexOf(row.controller)), opacity: 0.85, line: { color: css("--card"), width: 1 },
      size: [Math.max(5, 42 * Math.sqrt(Math.max(0, row.values[size] || 0) / most))],
    },
    hovertemplate: `<b>${plain(row.controller)}</b><br>platform pitch std %{x:.4g} deg<br>rotor speed std %{y:.4g} rpm<br>`
      + `blade-pitch travel ${figure(row.values[size])} deg/s<extra></extra>`,
  }));
  const front = rows.filter((a) => !rows.some((b) => b !== a && b.values[across] <= a.values[across] && b.values[up] <= a.values[up]
    && (b.values[across] < a.values[across] || b.values[up] < a.values[up])));
  front.sort((a, b) => a.values[across] - b.values[across]);
  const [x, y] = [[], []];
  front.forEach((row, i) => {
    if (i) { x.push(row.values[across]); y.push(front[i - 1].values[up]); }
    x.push(row.values[across]); y.push(row.values[up]);
  });
  traces.unshift({ type: "scatter", mode: "lines", x, y, hoverinfo: "skip", showlegend: false, line: { dash: "dot", width: 1.5, color: css("--soft") } });
  const range = (key) => {
    const values = rows.map((row) => row.values[key]);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    if (!values.length) return [0, 1];
    const pad = 0.22 * (high - low) || 0.2 * Math.abs(high) || 1;
    return [Math.max(0, low - pad), high + pad];
  };
  draw("pareto-plot", traces, {
    height: 430, xaxis: { title: { text: "platform pitch, standard deviation (deg)" }, range: range(across) },
    yaxis: { title: { text: "rotor speed, standard deviation (rpm)" }, range: range(up) },
  });
}

// ---- boxes -------------------------------------------------------------------------------------
function drawBoxes() {
  const [kind, name] = JSON.parse($("box-what").value);
  const traces = DATA.controllers.map((controller, i) => {
    const look = { type: "box", name: plain(controller), marker: { color: colour(i), size: 4 }, line: { width: 1.5 }, offsetgroup: String(i) };
    if (kind === "metric") {
      const points = DATA.runs.filter((run) => run[0] === controller && run[3][name] != null);
      return {
        ...look, x: points.map((run) => plain(run[1])), y: points.map((run) => run[3][name]), boxpoints: "all", jitter: 0.35, pointpos: 0,
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
    height: 440, boxmode: "group", xaxis: { type: "category", categoryorder: "array", categoryarray: DATA.cases.map(plain) },
    yaxis: { title: { text: plain(DATA.titles[name]) } },
  });
}

// ---- time series and spectra -------------------------------------------------------------------
const chosen = () => (DATA.series[$("series-case").value] || {})[$("series-seed").value] || {};

function panels(entries, field, axes) {
  // {traces, layout} of stacked panels; a channel that is the same for all controllers is drawn once
  const shape = {};
  const traces = [];
  const gap = 0.012;
  const height = (1 - gap * (axes.length - 1)) / axes.length;
  const named = new Set();
  axes.forEach((axis, number) => {
    const suffix = number ? String(number + 1) : "";
    const top = 1 - number * (height + gap);
    shape[`yaxis${suffix}`] = { domain: [Math.max(0, top - height), top], title: { text: axis.label, font: { size: 11 }, standoff: 8 }, ...axis.y };
    const held = DATA.controllers.map((controller, i) => [controller, i, entries[controller]]).filter(([, , run]) => run && run[field][axis.channel]);
    const same = held.length > 1 && held.every(([, , run]) => ["codes", "low", "high"].every((key) => run[field][axis.channel][key] === held[0][2][field][axis.channel][key]));
    for (const [controller, i, run] of same ? held.slice(0, 1) : held) {
      const packed = run[field][axis.channel];
      const y = decode(packed);
      traces.push({
        type: "scatter", mode: "lines", xaxis: "x", yaxis: `y${suffix}`,
        x: y.map((_, k) => packed.start + k * packed.step), y: axis.power ? y.map((v) => (v === null ? null : 10 ** v)) : y,
        name: same ? "all controllers" : plain(controller), legendgroup: same ? "all" : String(i), showlegend: !named.has(same ? "all" : i),
        line: { width: 1.2, color: same ? css("--soft") : colour(i) }, hovertemplate: "%{y:.4g}",
      });
      named.add(same ? "all" : i);
    }
  });
  return { traces, shape };
}

function drawSeries() {
  const entries = chosen();
  const axes = DATA.panels.filter((panel) => Object.values(entries).some((run) => run.series[panel.channel]));
  const { traces, shape } = panels(entries, "series", axes);
  const skips = Object.values(entries).map((run) => run.skip).filter((skip) => skip > 0);
  const start = Math.min(...Object.values(entries).map((run) => run.start));
  draw("series-plot", traces, {
    ...shape, height: 90 + 118 * Math.max(1, axes.length), hovermode: "x",
    xaxis: { title: { text: "time (s)" }, anchor: axes.length > 1 ? `y${axes.length}` : "y" },
    shapes: skips.length ? [{ type: "rect", xref: "x", yref: "paper", x0: start, x1: start + Math.max(...skips), y0: 0, y1: 1, fillcolor: css("--soft"), opacity: 0.09, line: { width: 0 } }] : [],
  });
}

function drawSpectra() {
  const entries = chosen();
  const axes = DATA.spectra.filter((panel) => Object.values(entries).some((run) => run.spectra[panel.channel]))
    .map((panel) => ({ ...panel, power: true, y: { type: "log", exponentformat: "power" } }));
  const { traces, shape } = panels(entries, "spectra", axes);
  const marks = (Object.values(entries)[0] || {}).marks || [];
  draw("spectra-plot", traces, {
    ...shape, height: 100 + 190 * Math.max(1, axes.length), hovermode: "x", margin: { l: 64, r: 16, t: 44, b: 48 },
    xaxis: { type: "log", title: { text: "frequency (Hz)" }, range: [Math.log10(0.005), Math.log10(0.5)], tickvals: [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1], anchor: axes.length > 1 ? `y${axes.length}` : "y" },
    legend: { orientation: "h", yanchor: "bottom", y: 1.05, x: 0 },
    shapes: marks.map((mark) => ({ type: "line", xref: "x", yref: "paper", x0: mark[1], x1: mark[1], y0: 0, y1: 1, line: { width: 1, dash: "dash", color: css("--soft") } })),
    annotations: marks.map((mark) => ({ xref: "x", yref: "paper", x: Math.log10(mark[1]), y: 1, yanchor: "bottom", showarrow: false, text: plain(mark[0]), font: { size: 11, color: css("--soft") } })),
  });
}

function drawSchedule() {
  if (!DATA.schedule) return;
  const shape = {};
  const across = 3;
  const down = Math.ceil(DATA.schedule.panels.length / across);
  const traces = DATA.schedule.panels.map((panel, i) => {
    const suffix = i ? String(i + 1) : "";
    const [column, row] = [i % across, Math.floor(i / across)];
    const [left, top] = [column / across + 0.04, 1 - row / down];
    shape[`xaxis${suffix}`] = { domain: [left, (column + 1) / across - 0.01], anchor: `y${suffix}`, title: row === down - 1 ? { text: "wind (m/s)" } : undefined };
    shape[`yaxis${suffix}`] = { domain: [top - 1 / down + 0.11, top - 0.05], anchor: `x${suffix}` };
    return { type: "scatter", mode: "lines+markers", x: DATA.schedule.wind, y: panel.values, xaxis: `x${suffix}`, yaxis: `y${suffix}`, showlegend: false, line: { width: 2, color: colour(0) }, marker: { size: 4 }, hovertemplate: "%{x:g} m/s: %{y:.5g}<extra></extra>" };
  });
  const annotations = DATA.schedule.panels.map((panel, i) => ({
    xref: "paper", yref: "paper", x: (i % across) / across + 0.04, y: 1 - Math.floor(i / across) / down - 0.045, xanchor: "left", yanchor: "bottom", showarrow: false, text: `<b>${plain(panel.label)}</b>`, font: { size: 12 },
  }));
  draw("schedule-plot", traces, { ...shape, height: 200 * down + 60, annotations, margin: { l: 30, r: 10, t: 10, b: 50 } });
}

// ---- the page ----------------------------------------------------------------------------------
function chooseSeeds() {
  fill($("series-seed"), Object.keys(DATA.series[$("series-case").value] || {}));
}
function drawAll() {
  drawTable(); drawWinds(); drawPareto(); drawBoxes(); drawSeries(); drawSpectra(); drawSchedule();
}
fill($("table-case"), [ALL, ...DATA.cases], ["all cases", ...DATA.cases]);
for (const [kind, title, names] of [["samples", "samples of a channel", Object.keys(DATA.quantiles)], ["metric", "metrics of the runs", DATA.metrics.map((m) => m.name)]]) {
  if (!names.length) continue;
  const group = document.createElement("optgroup");
  group.label = title;
  group.append(...names.map((name) => new Option(DATA.titles[name], JSON.stringify([kind, name]))));
  $("box-what").append(group);
}
const compared = DATA.metrics.filter((metric) => metric.name !== "score");
fill($("wind-what"), compared.map((metric) => metric.name), compared.map((metric) => DATA.titles[metric.name] || metric.label));
fill($("table-view"), Object.keys(DATA.views), Object.values(DATA.views));
$("table-view").parentElement.hidden = Object.keys(DATA.views).length < 2;
fill($("series-case"), Object.keys(DATA.series));
chooseSeeds();
document.documentElement.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
$("theme").addEventListener("click", () => { document.documentElement.dataset.theme = dark() ? "light" : "dark"; drawAll(); });
$("table-case").addEventListener("change", () => { drawTable(); drawPareto(); });
$("table-view").addEventListener("change", drawTable);
$("all-columns").addEventListener("change", drawTable);
$("wind-what").addEventListener("change", drawWinds);
$("box-what").addEventListener("change", drawBoxes);
$("series-case").addEventListener("change", () => { chooseSeeds(); drawSeries(); drawSpectra(); });
$("series-seed").addEventListener("change", () => { drawSeries(); drawSpectra(); });
drawAll();
