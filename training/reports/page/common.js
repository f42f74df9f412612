"use strict";
const DATA = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const LIGHT = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#3F9BD8", "#7A52C7", "#7f7f7f", "#8C564B", "#17becf"];
const DARK = ["#4DA6E0", "#FF8B4A", "#35C99A", "#E79BC4", "#F0B93A", "#8CCBF5", "#B79BF5", "#b0b0b0", "#C49C94", "#5fe0ec"];
const dark = () => document.documentElement.dataset.theme === "dark";
const colour = (i) => (dark() ? DARK : LIGHT)[i % LIGHT.length];
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
// plotly interprets some tags in texts: names are escaped
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

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
let paper = false; // a printer's page is narrower than most windows
const CONFIG = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
const draw = (id, traces, shape) => Plotly.react($(id), traces, layout(paper ? { ...shape, width: 680 } : shape), CONFIG);

function fill(select, values, texts) {
  select.replaceChildren(...values.map((value, i) => new Option((texts || values)[i], value)));
}
function element(tag, text, kind) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
}
function explain(target, text) {
  // the tooltip shows the data-tip of the element under the pointer or with the keyboard focus
  target.dataset.tip = text;
  if (!target.matches("button, a, select, [tabindex]")) target.tabIndex = 0;
  return target;
}

// ---- explanations ------------------------------------------------------------------------------
let explained = null;
function showTip(target) {
  const tip = $("tip");
  tip.textContent = target.dataset.tip;
  tip.hidden = false;
  explained = target;
  target.setAttribute("aria-describedby", "tip");
  const [at, own] = [target.getBoundingClientRect(), tip.getBoundingClientRect()];
  if (at.bottom < 0 || at.top > window.innerHeight) { hideTip(); return; }
  const below = at.bottom + 6 + own.height < window.innerHeight;
  tip.style.left = `${Math.max(8, Math.min(at.left, window.innerWidth - own.width - 8))}px`;
  tip.style.top = `${below ? at.bottom + 6 : Math.max(8, at.top - own.height - 6)}px`;
}
function hideTip() {
  if (explained) explained.removeAttribute("aria-describedby");
  explained = null;
  $("tip").hidden = true;
}
for (const [kind, show] of [["pointerover", true], ["focusin", true], ["click", true], ["pointerout", false], ["focusout", false]]) {
  document.addEventListener(kind, (event) => {
    const target = event.target.closest && event.target.closest("[data-tip]");
    if (target && show) showTip(target);
    else if (show && kind === "click") hideTip();
    else if (!show && target && !target.contains(event.relatedTarget)) {
      if (kind === "focusout" || (event.relatedTarget !== $("tip") && document.activeElement !== target)) hideTip();
    }
  });
}
$("tip").addEventListener("pointerleave", hideTip);
document.addEventListener("keydown", (event) => { if (event.key === "Escape") hideTip(); });
// the tooltip follows its element on scroll
document.addEventListener("scroll", () => { if (explained) showTip(explained); }, { passive: true, capture: true });

// ---- tables that scroll ------------------------------------------------------------------------
function markScrolling(outer) {
  const inner = outer.firstElementChild;
  const hidden = inner.scrollWidth - inner.clientWidth;
  outer.classList.toggle("wide", hidden > 2);
  outer.classList.toggle("more", hidden - inner.scrollLeft > 2);
}
for (const outer of document.querySelectorAll(".scroll")) {
  outer.append(element("p", "scroll sideways for more columns ↔", "hint"));
  outer.firstElementChild.addEventListener("scroll", () => markScrolling(outer), { passive: true });
  new ResizeObserver(() => markScrolling(outer)).observe(outer.firstElementChild.firstElementChild);
  new ResizeObserver(() => markScrolling(outer)).observe(outer);
}

// ---- numbers -------------------------------------------------------------------------------------
function figure(value) {
  if (value === null || value === undefined) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e6 || size < 1e-3 ? size.toExponential(2) : size >= 1000 ? size.toFixed(0) : size.toPrecision(size >= 100 ? 4 : 3);
  return `${value < 0 ? "\u2212" : ""}${text}`;
}
function percentage(percent) {
  const size = Math.abs(percent);
  const text = size.toFixed(size >= 9.95 ? 0 : size >= 0.095 ? 1 : 2);
  return Number(text) === 0 ? "±0 %" : `${percent > 0 ? "+" : "\u2212"}${text} %`;
}

// ---- theme ---------------------------------------------------------------------------------------
function setTheme(isDark) {
  document.documentElement.dataset.theme = isDark ? "dark" : "light";
}
function followTheme() {
  // light or dark as the system or the button says, and light on paper; drawAll is the page's
  const darkness = matchMedia("(prefers-color-scheme: dark)");
  setTheme(darkness.matches);
  darkness.addEventListener("change", () => { setTheme(darkness.matches); drawAll(); });
  $("theme").addEventListener("click", () => { setTheme(!dark()); drawAll(); });
  let shownTheme = null;
  window.addEventListener("beforeprint", () => { shownTheme = dark(); paper = true; setTheme(false); drawAll(); });
  window.addEventListener("afterprint", () => { paper = false; setTheme(shownTheme); drawAll(); });
}
