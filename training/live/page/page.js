"use strict";
// What the page does beside Bokeh: theme, moving turbines, the delay from a slider to the picture.
const fowt = {
  delays: [], since: null,
  say() {
    const { data } = Bokeh.documents[0].get_model_by_name("words");
    for (const key in data) {
      const place = document.getElementById(key);
      if (place.dataset.text !== data[key][0]) place.innerHTML = place.dataset.text = data[key][0];
    }
  },
  motions: { A: {}, B: {} },
  // columns that came as one array; the server need not know them apart
  unpack(kind, side) {
    const doc = Bokeh.documents[0], { data: { values }, tags } = doc.get_model_by_name(`${kind}_packed_${side}`);
    const count = values.length / tags.length;
    const columns = Object.fromEntries(tags.map((name, i) =>
      [name, new Float32Array(values.buffer, values.byteOffset + 4 * i * count, count)]));
    if (kind === "film") { this.motions[side] = columns; return; }
    doc.get_model_by_name(`series_${side}`).setv({ data: columns }, { sync: false });
    this.drawn();
  },
  moved() { if (this.since === null) this.since = performance.now(); },
  // Bokeh paints in the next frame; the message after that frame ends the delay
  drawn() {
    if (this.since === null) return;
    const since = this.since;
    this.since = null;
    requestAnimationFrame(() => {
      const channel = new MessageChannel();
      channel.port1.onmessage = () => {
        this.delays.push(performance.now() - since);
        const sorted = [...this.delays].sort((a, b) => a - b);
        const at = part => sorted[Math.min(sorted.length - 1, Math.floor(part * sorted.length))].toFixed(0);
        document.getElementById("delay").textContent =
          `slider to picture: ${this.delays.at(-1).toFixed(0)} ms (median ${at(0.5)}, 95 % ${at(0.95)})`;
      };
      channel.port2.postMessage(null);
    });
  },
};
window.fowt = fowt;
const G = 9.81, TURN = Math.PI / 180;

// At each painting of a figure Bokeh reads the style of its parts a hundred times and writes dozens of style
// sheets, most of them as they were, and the browser resolves the styles of the page in between. No variable
// --bk-... is set on this page, so there is nothing to read. A Bokeh with other internals only paints slower.
function lighten() {
  try {
    const visual = Bokeh.require("core/visuals/visual").VisualProperties.prototype;
    const sheet = Bokeh.require("core/dom").InlineStyleSheet.prototype, update = sheet._update;
    if (visual._get_css_value) visual._get_css_value = () => "";
    if (update) sheet._update = function (css) { if (this.el.textContent !== css) update.call(this, css); };
  } catch (error) { console.info(`fowt tune: ${error}`); }
}

function theme(isDark) {
  document.documentElement.dataset.theme = isDark ? "dark" : "light";
  const style = getComputedStyle(document.documentElement), value = name => style.getPropertyValue(name).trim();
  const [soft, line] = ["--soft", "--line"].map(value);
  const doc = Bokeh.documents[0];
  const paint = (model, colours) => model.setv(colours, { sync: false });  // the server need not know
  for (const model of doc._all_models.values()) {
    if (model.type.endsWith("Axis")) {
      paint(model, { major_label_text_color: soft, axis_label_text_color: soft, axis_line_color: line,
        major_tick_line_color: line });
    } else if (model.type === "Grid") paint(model, { grid_line_color: line });
    else if (model.type === "GlyphRenderer") {
      const colour = value({ A: "--A", B: "--B" }[model.data_source.name.slice(-1)] ?? "--soft");
      paint(model.glyph, { line_color: colour });
    }
  }
}

function interpolated(data, time) {
  const times = data.time, last = (times || []).length - 1;
  if (last < 1) return null;
  const place = Math.min(Math.max((time - times[0]) / (times[1] - times[0]), 0), last - 1e-9);
  const i = Math.floor(place), f = place - i, row = {};
  for (const key in data) row[key] = (1 - f) * data[key][i] + f * data[key][i + 1];
  return row;
}

class Film {
  constructor(canvas, doc) {
    this.canvas = canvas;
    this.shape = doc.get_model_by_name("shape");
    this.clock = 60;
    this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.before = performance.now();
    const step = now => { this.step(now); requestAnimationFrame(step); };
    requestAnimationFrame(step);
  }
  get length() { return (fowt.motions.B.time || [0]).at(-1) || 0; }
  step(now) {
    const rate = Number(document.getElementById("rate").value);
    if (now - this.before < 40) return;
    const slider = document.getElementById("time");
    if (this.playing) {
      this.clock += rate * Math.min(0.1, (now - this.before) / 1000);
      if (this.clock >= this.length) this.clock = 0;
      slider.value = this.clock / (this.length || 1);
    }
    this.before = now;
    const key = `${this.clock} ${this.canvas.clientWidth} ${document.documentElement.dataset.theme}`;
    const { A, B } = fowt.motions;
    if (key !== this.key || A !== this.last?.[0] || B !== this.last[1]) this.draw();
    this.key = key;
    this.last = [A, B];
  }
  draw() {
    const { canvas } = this, sharp = Math.min(2, window.devicePixelRatio || 1);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== width * sharp || canvas.height !== height * sharp) {
      canvas.width = width * sharp; canvas.height = height * sharp;
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    const shape = JSON.parse(this.shape.data.json[0]);
    if (!shape.radius) return;
    ["A", "B"].forEach((side, i) => this.turbine(pen, shape, side, i * width / 2, width / 2, height));
  }
  turbine(pen, shape, side, left, width, height) {
    const row = interpolated(fowt.motions[side], this.clock);
    if (row === null) return;
    const style = getComputedStyle(document.documentElement), isDark = document.documentElement.dataset.theme === "dark";
    const colour = style.getPropertyValue(`--${side}`).trim();
    const top = shape.hub[1] + 1.1 * shape.radius, bottom = -0.85 * shape.radius;
    const scale = height / (top - bottom), middle = left + 0.5 * width;
    const pitch = row.pitch * TURN, cos = Math.cos(pitch), sin = Math.sin(pitch);
    // body x, y, z to pixels; y by a cabinet projection, as in the animations of fowt dev animate
    const put = (x, y, z) => [
      middle + scale * (row.surge - this.mean(side, "surge") + cos * x + sin * z + shape.shift * y),
      scale * (top - (row.heave - sin * x + cos * z))];
    const fill = (points, paint, edge) => {
      pen.beginPath();
      points.forEach((point, i) => i ? pen.lineTo(...point) : pen.moveTo(...point));
      pen.closePath();
      pen.fillStyle = paint;
      pen.fill();
      if (edge) { pen.strokeStyle = edge; pen.lineWidth = 1; pen.stroke(); }
    };
    pen.save();
    pen.beginPath();
    pen.rect(left, 0, width - 2, height);
    pen.clip();
    pen.fillStyle = isDark ? "#182434" : "#dcebf7";
    pen.fillRect(left, 0, width, height);
    for (const { ends, widths } of shape.members) {
      const [a, b] = ends.map(end => put(...end)), long = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
      const across = [-(b[1] - a[1]) / long, (b[0] - a[0]) / long];
      const [p, q] = widths.map(each => Math.max(1.5, 0.5 * scale * each));
      fill([[a[0] + p * across[0], a[1] + p * across[1]], [b[0] + q * across[0], b[1] + q * across[1]],
        [b[0] - q * across[0], b[1] - q * across[1]], [a[0] - p * across[0], a[1] - p * across[1]]],
        "#f0be28", "#8a6d12");
    }
    const [low, high, wide, narrow] = shape.tower;
    fill([put(-wide / 2, 0, low), put(wide / 2, 0, low), put(narrow / 2, 0, high), put(-narrow / 2, 0, high)],
      isDark ? "#c8d0da" : "#f4f6f8", "#6a7685");
    // the sea over what is submerged; a wave of the record runs past at the speed of its period
    const period = Math.max(3, this.period(side)), speed = G * period / (2 * Math.PI);
    pen.beginPath();
    for (let x = 0; x <= width; x += 4) {
      const ago = this.clock - (left + x - middle) / scale / speed;
      const wave = interpolated(fowt.motions[side], ago);
      pen[x ? "lineTo" : "moveTo"](left + x, scale * (top - wave.wave));
    }
    pen.lineTo(left + width, height); pen.lineTo(left, height);
    pen.closePath();
    pen.fillStyle = isDark ? "rgba(20,70,110,0.72)" : "rgba(38,110,158,0.62)";
    pen.fill();
    const [hx, hz] = shape.hub, radius = shape.radius;
    fill([put(hx, 0, hz - 0.03 * radius), put(0.17 * radius, 0, hz - 0.03 * radius), put(0.17 * radius, 0, hz + 0.03 * radius),
      put(hx, 0, hz + 0.03 * radius)], "#dfe4ea", "#6a7685");
    for (let n = 0; n < shape.blades; n += 1) {
      const angle = row.azimuth * TURN + 2 * Math.PI * n / shape.blades;
      const [ry, rz, ty, tz] = [-Math.sin(angle), Math.cos(angle), -Math.cos(angle), -Math.sin(angle)];
      const edge = (r, part) => put(hx, r * ry + part * ty, hz + r * rz + part * tz);
      const thick = ([r, chord]) => [r, Math.max(chord, 0.05 * radius * (1.3 - r / radius))];
      const widths = shape.blade.map(thick);
      fill([...widths.map(([r, chord]) => edge(r, 0.35 * chord)), edge(radius, 0),
        ...widths.slice().reverse().map(([r, chord]) => edge(r, -0.65 * chord))], "#ffffff", "#3d4a5a");
    }
    const hub = put(hx, 0, hz);
    pen.beginPath();
    pen.arc(...hub, Math.max(3, 0.04 * radius * scale), 0, 7);
    pen.fillStyle = colour;
    pen.fill();
    pen.fillStyle = style.getPropertyValue("--ink");
    pen.font = "600 13px system-ui, sans-serif";
    pen.fillText(side, left + 8, 18);
    pen.font = "12px system-ui, sans-serif";
    const words = width < 260 ? [`${this.clock.toFixed(0)} s`, `pitch ${row.pitch.toFixed(1)} deg`] : [`${this.clock.toFixed(0)} s   wind ${row.wind.toFixed(1)} m/s`, `rotor ${row.speed.toFixed(2)} rpm`,
      `platform pitch ${row.pitch.toFixed(2)} deg`, `blade pitch ${row.blade.toFixed(1)} deg`];
    words.forEach((text, i) => pen.fillText(text, left + (i ? 8 : 26), 18 + 16 * i));
    pen.restore();
  }
  mean(side, key) {
    return this.kept(side, key, values => values.reduce((sum, each) => sum + each, 0) / values.length);
  }
  period(side) {  // mean time between upcrossings of the wave record
    return this.kept(side, "wave", values => {
      let count = 0;
      for (let i = 1; i < values.length; i += 1) count += values[i - 1] < 0 && values[i] >= 0;
      return count ? this.length / count : 10;
    });
  }
  kept(side, key, make) {
    const data = fowt.motions[side];
    this.store ??= new WeakMap();
    if (!this.store.has(data)) this.store.set(data, new Map());
    const map = this.store.get(data);
    if (!map.has(key)) map.set(key, make(data[key]));
    return map.get(key);
  }
}

function begin() {
  const doc = window.Bokeh && Bokeh.documents[0];
  if (!doc || !doc.get_model_by_name("shape")) { setTimeout(begin, 30); return; }
  lighten();
  const dark = matchMedia("(prefers-color-scheme: dark)");
  theme(dark.matches);
  dark.addEventListener("change", () => theme(dark.matches));
  const $ = id => document.getElementById(id);
  $("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme !== "dark"));
  const film = fowt.film = new Film($("film"), doc), play = $("play");
  const show = () => { play.textContent = film.playing ? "pause" : "play"; play.setAttribute("aria-pressed", film.playing); };
  show();
  play.addEventListener("click", () => { film.playing = !film.playing; show(); });
  $("time").addEventListener("input", () => { film.clock = $("time").value * film.length; });
  $("copy").addEventListener("click", async () => {
    await navigator.clipboard.writeText($("command").textContent);
    $("copy").textContent = "copied";
    setTimeout(() => { $("copy").textContent = "copy the command"; }, 1500);
  });
  fowt.say();
  for (const side of ["A", "B"]) for (const kind of ["series", "film"]) fowt.unpack(kind, side);  // came with the page
  fowt.ready = true;
}
addEventListener("DOMContentLoaded", begin);
