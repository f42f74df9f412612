"""Builds the page of fowt tune: sliders and figures of Bokeh, filled by tuning.py in a worker thread.

A change of a slider is answered in parts, the picture of the run first; a newer change ends the parts of an
older one. The picture is sent as one array for each law, and its axes stay while the curves fit in them, as
Bokeh lays a figure out anew for other numbers at an axis. Bokeh alone is used, without Panel: it adds two
packages to those of this project, draws on a canvas, sends arrays as binary data and is its own server.
"""

import html
import json
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Event, Lock
from time import perf_counter
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import (
    BasicTickFormatter,
    Button,
    ColumnDataSource,
    CustomJS,
    Div,
    InlineStyleSheet,
    Range1d,
    Select,
    Slider,
    Spinner,
    TextInput,
)  # fmt: skip
from bokeh.plotting import figure
from jinja2 import Template

from fowt_env.descriptions.checks import parse_number
from fowt_env.descriptions.platform import platform_names
from fowt_env.display import number_text
from fowt_env.errors import InputError
from fowt_env.training.evaluation.metric_names import SHORT, short_name
from fowt_env.training.evaluation.metrics import better
from fowt_env.training.live import tuning
from fowt_env.training.live.tuning import Law, Weather
from fowt_env.training.reports.metric_words import about_metric
from fowt_env.training.reports.verdict import percent_text
from fowt_env.visual.rendering import DEPTH_SHIFT, solids
from fowt_env.visual.style import COLOURS

SIDES = ("A", "B")  # the law beside, and the one that is tuned
COLOUR = dict(zip(SIDES, COLOURS, strict=False))
COUNTS = ("1", "4", "6", "12")  # of seeds
WIND_RANGE = (4.0, 25.0)  # m/s, of the slider
TEXTS = ("status", "verdict", "command", "table", "loops", "saved")  # elements of the page
WEATHER, MOVED = tuning.SERIES[:2], tuning.SERIES[2:]  # of the conditions alone, and those of a law
FILM = ("time", "wave", "wind", *tuning.MOTION)
FILLED = 0.6  # part of an axis that the curves must fill, else it is set anew
LINE_WIDTH = 1.0  # pixels; without a graphics card a line of 1.3 takes five times as long to paint
PAUSE = 0.15  # s without a change, after which more than the picture is computed
FOLDER = Path(__file__).parent / "page"
STYLE = """
:host { --background-color: var(--card); color: var(--ink); font-size: 13px; }
.bk-input { background-color: var(--card); color: var(--ink); border-color: var(--line); }
.bk-input:focus, .noUi-handle:focus, .bk-btn:focus { outline: 2px solid var(--accent); }
.noUi-target { background: var(--line); border-color: var(--line); }
.noUi-handle { background: var(--card); border-color: var(--accent); }
.noUi-connect { background: var(--accent); }
.bk-btn, .bk-btn-default { background-color: var(--card); color: var(--ink); border-color: var(--line); }
.bk-btn-default:hover { background-color: var(--hover); }
a { color: var(--accent); }
table { border-collapse: collapse; width: 100%; }
td, th { padding: 2px 7px; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
td:first-child, th:first-child { text-align: left; }
.better { color: var(--better); } .worse { color: var(--worse); } .bad { color: var(--bad); }
.soft { color: var(--soft); }
"""
executor = ThreadPoolExecutor(1, thread_name_prefix="fowt-tune")  # one computation at a time, of all pages


class Page:
    """Holds one open page: its widgets, its sources of data, and what is being computed for it."""

    def __init__(self, doc: Document, weather: Weather, laws: Sequence[Law], further: Sequence[str] = ()):
        """Build the page in a document. laws: A, beside, and B, tuned; further: names for the menus."""
        self.doc, self.weather, self.laws = doc, weather, dict(zip(SIDES, laws, strict=True))
        self.lock, self.number, self.is_busy, self.notes = Lock(), 0, False, ""
        self.began, self.shown, self.wake = perf_counter(), {}, Event()
        self.sheet = InlineStyleSheet(css=STYLE)
        self.names = tuning.choices((*further, *(law.controller for law in laws)))
        self.sources: dict[str, dict[str, ColumnDataSource]] = {}
        self.words = ColumnDataSource({key: [""] for key in TEXTS}, name="words")
        self.words.js_on_change("data", CustomJS(code="fowt.say()"))
        self.is_setting = False  # while the page itself changes its widgets
        self._widgets()
        self._figures()
        doc.title = "fowt tune"
        doc.template = Template((FOLDER / "page.html").read_text(encoding="utf-8"))
        doc.template_variables.update(
            style=(FOLDER.parent.parent / "reports" / "page" / "page.css").read_text(encoding="utf-8")
            + (FOLDER / "page.css").read_text(encoding="utf-8"),
            script=(FOLDER / "page.js").read_text(encoding="utf-8"),
        )
        self.request()

    # widgets

    def _widget(self, kind, **settings):
        return kind(stylesheets=[self.sheet], sizing_mode="stretch_width", **settings)

    def _root(self, name, *children):
        self.doc.add_root(column(*children, name=name, sizing_mode="stretch_width", stylesheets=[self.sheet]))

    def _say(self, **texts):
        """Set texts (HTML) of the page by the id of their element; Bokeh's own texts would lay out anew."""
        self.words.data = {key: list(value) for key, value in self.words.data.items()} | {
            key: [text] for key, text in texts.items()
        }

    def _widgets(self):
        weather = self.weather
        self.platform = self._widget(
            Select, title="platform", options=_platforms(weather), value=weather.platform
        )
        self.wind = self._widget(TextInput, title="wind", value=weather.wind, name="wind")
        speed = _speed(weather.wind)
        low, high = WIND_RANGE
        self.speed = self._widget(
            Slider, title="mean wind (m/s)", name="speed", start=low, end=high, step=0.5,
            disabled=speed is None,
            value=min(max(speed or low, low), high),
        )  # fmt: skip
        self.sea = self._widget(TextInput, title="sea", value=weather.sea, name="sea")
        self.seed = self._widget(Spinner, title="seed", low=0, step=1, value=weather.seed, name="seed")
        low, high = tuning.DURATIONS
        self.duration = self._widget(
            Spinner, title="duration (s)", low=low, high=high, step=60.0, value=weather.duration
        )
        self.count = self._widget(Select, title="seeds of the ratios", options=list(COUNTS), value="6")
        for widget in (self.platform, self.wind, self.sea, self.seed, self.duration, self.count):
            widget.on_change("value", self._conditions_changed)
        self.speed.on_change("value", self._speed_changed)
        self.speed.js_on_change("value", CustomJS(code="fowt.moved()"))
        pair = partial(row, sizing_mode="stretch_width")
        self._root(
            "conditions",
            self.platform,
            self.wind,
            self.speed,
            self.sea,
            pair(self.seed, self.duration),
            self.count,
        )
        self.menus, self.panels = {}, {}
        for side in SIDES:
            menu = self._widget(
                Select, title="controller", options=self.names, value=self.laws[side].controller,
                name=f"controller_{side}",
            )  # fmt: skip
            menu.on_change("value", partial(self._controller_changed, side))
            self.menus[side] = menu
            self.panels[side] = column(*self._sliders(side), sizing_mode="stretch_width")
            self._root(f"law_{side}", menu, self.panels[side])
        keep = self._widget(Button, label="keep B beside as A", name="keep")
        swap = self._widget(Button, label="swap A and B", name="swap")
        restore = self._widget(Button, label="restore B", name="restore")
        keep.on_click(lambda: self.set_laws(self.laws["B"], self.laws["B"]))
        swap.on_click(lambda: self.set_laws(self.laws["B"], self.laws["A"]))
        restore.on_click(lambda: self.set_laws(self.laws["A"], Law(self.laws["B"].controller)))
        self.file = self._widget(
            TextInput, title="save B as a design, in the working folder", value="tuned.json", name="file"
        )
        save = self._widget(Button, label="save as design", name="save")
        save.on_click(self._save)
        self._root("actions", pair(keep, swap), restore, self.file, save)

    def _sliders(self, side):
        """Return the sliders of the law of a side, or a text where it has no settings here."""
        known, values = tuning.tunable(self.laws[side].controller), tuning.settings_of(self.laws[side])
        if known is None:
            return [self._widget(Div, text="<span class=soft>no settings to move</span>")]
        sliders = []
        for key, (low, high) in known.ranges.items():
            step = _step(low, high)
            low, high = min(low, values[key]), max(high, values[key])
            slider = self._widget(
                Slider, title=key, start=low, end=high, step=step, value=values[key], format=_format(step),
                name=f"{side}_{key}",
            )  # fmt: skip
            slider.on_change("value", partial(self._setting_changed, side, key))
            slider.js_on_change("value", CustomJS(code="fowt.moved()"))
            sliders.append(slider)
        return sliders

    # figures

    def _plot(self, height, x_label=None, **settings):
        plot = figure(
            height=height, sizing_mode="stretch_width", min_width=120, toolbar_location=None,
            tools="xpan,xwheel_zoom,reset", active_scroll=None, output_backend="canvas", lod_threshold=None,
            background_fill_color=None, border_fill_color=None, outline_line_color=None, **settings,
        )  # fmt: skip
        plot.xaxis.axis_label, plot.axis.minor_tick_line_color = x_label, None
        plot.axis.ticker.desired_num_ticks = 5
        plot.axis.major_label_text_font_size = plot.axis.axis_label_text_font_size = "11px"
        return plot

    def _source(self, kind, columns):
        self.sources[kind] = {
            side: ColumnDataSource({name: [0.1, 1.0] for name in columns}, name=f"{kind}_{side}")
            for side in SIDES
        }

    def _lines(self, plot, kind, x, y):
        for side in SIDES:
            plot.line(x, y, source=self.sources[kind][side], color=COLOUR[side], line_width=LINE_WIDTH)

    def _figures(self):
        self._source("series", ["time", *(channel for _, channel in MOVED)])
        self._source("spectra", ["frequency", *(channel for _, channel in tuning.SPECTRA)])
        events = [f"{event} {channel}" for event in ("step", "gust") for _, channel in tuning.RESPONSES]
        self._source("responses", ["time", *events])
        self._source("poles", ["real", "imaginary"])
        shape = ColumnDataSource({"json": ["{}"]}, name="shape")
        self.sources["shape"] = {"A": shape}
        self.weather_source = ColumnDataSource(
            {name: [0.0, 1.0] for name in ("time", *(channel for _, channel in WEATHER))}, name="weather"
        )
        self.packed = {"series": list(self.sources["series"]["A"].data), "film": list(FILM)}
        for side in SIDES:  # the page's own script unpacks the series, and draws the motions
            for kind, names in self.packed.items():
                source = ColumnDataSource(
                    {"values": np.zeros(2 * len(names), np.float32)}, name=f"{kind}_packed_{side}", tags=names
                )
                source.js_on_change("data", CustomJS(code=f"fowt.unpack('{kind}', '{side}')"))
                self.sources.setdefault(f"packed {kind}", {})[side] = source
            sources = [self.sources[f"packed {kind}"][side] for kind in self.packed]
            self.doc.add_root(_carrier(f"carrier_{side}", *sources, shape, self.words))
        plots, self.time_axis, self.axes = [], Range1d(0.0, 1.0), {}
        for number, (label, channel) in enumerate(tuning.SERIES):
            last = number >= len(tuning.SERIES) - 2
            self.axes[channel] = Range1d(0.0, 1.0)
            plot = self._plot(
                144 if last else 104, "time (s)" if last else None, x_range=self.time_axis,
                y_range=self.axes[channel],
            )  # fmt: skip
            plot.xaxis.visible = last  # text is most of the time of a redraw
            if number < len(WEATHER):
                plot.line("time", channel, source=self.weather_source, line_width=LINE_WIDTH)
            else:
                self._lines(plot, "series", "time", channel)
            plot.yaxis.formatter = BasicTickFormatter(use_scientific=False)
            plots.append((plot, label))
        self._grid("series", plots)
        plots = []
        for label, channel in tuning.SPECTRA:
            plot = self._plot(170, "frequency (Hz)", x_axis_type="log", y_axis_type="log")
            self._lines(plot, "spectra", "frequency", channel)
            quantity, _, unit = label.removesuffix(")").rpartition(" (")
            plots.append((plot, f"spectrum of {quantity} ({unit.replace(' ', '² ')}²/Hz)"))
        self._grid("spectra", plots)
        plots = []
        for event, words in (("step", f"step of {tuning.STEP:g} m/s"), ("gust", "extreme operating gust")):
            for label, channel in tuning.RESPONSES:
                plot = self._plot(160, "time (s)")
                self._lines(plot, "responses", "time", f"{event} {channel}")
                plots.append((plot, f"{words}: {label}"))
        self._grid("responses", plots)
        poles = self._plot(300, "real part", x_range=Range1d(-0.6, 0.1), y_range=Range1d(0.0, 1.0))
        poles.yaxis.axis_label = "imaginary part"
        for side, marker in zip(SIDES, ("x", "circle"), strict=True):
            poles.scatter(
                "real", "imaginary", source=self.sources["poles"][side], marker=marker, size=9,
                line_width=1.8, color=COLOUR[side], fill_color=None if marker == "circle" else COLOUR[side],
            )  # fmt: skip
        self._grid("poles", [(poles, "poles of the closed loop at the mean wind (rad/s)")])

    def _grid(self, name, plots):
        """Add (figure, heading) to the page; a heading in HTML needs no painting."""
        for number, (plot, _) in enumerate(plots):
            plot.name = f"{name}_{number}"
            self.doc.add_root(plot)
        self.doc.template_variables[name] = [(plot.name, heading) for plot, heading in plots]

    # what the user changes

    def _conditions_changed(self, attribute, old, new):
        if self.is_setting:
            return
        try:
            chosen = Weather(
                self.platform.value, self.wind.value.strip(), self.sea.value.strip(),
                int(self.seed.value or 0), float(self.duration.value or 0.0),
            )  # fmt: skip
            chosen.scene()
        except (InputError, OSError) as error:
            self._fail(error)
            return
        self.weather = chosen
        speed = _speed(chosen.wind)
        self.speed.disabled = speed is None
        if speed is not None and WIND_RANGE[0] <= speed <= WIND_RANGE[1]:
            self._silently(lambda: setattr(self.speed, "value", speed))
        self.request()

    def _speed_changed(self, attribute, old, new):
        if not self.is_setting:
            self.wind.value = _with_speed(self.wind.value, new)

    def _controller_changed(self, side, attribute, old, new):
        if not self.is_setting:
            self.laws[side] = Law(new)
            self.panels[side].children = self._sliders(side)
            self.request()

    def _setting_changed(self, side, key, attribute, old, new):
        if not self.is_setting:
            self.laws[side] = tuning.changed(
                self.laws[side], tuning.settings_of(self.laws[side]) | {key: new}
            )
            self.request()

    def set_laws(self, first: Law, second: Law) -> None:
        """Set the laws of A and B, and the widgets to them."""
        for side, law in zip(SIDES, (first, second), strict=True):
            if law != self.laws[side]:
                self.laws[side] = law
                self._silently(partial(setattr, self.menus[side], "value", law.controller))
                self.panels[side].children = self._sliders(side)
        self.request()

    def _silently(self, change):
        self.is_setting = True
        try:
            change()
        finally:
            self.is_setting = False

    def _save(self):
        try:
            path = Path(self.file.value.strip())
            if path.name != str(path) or path.suffix.lower() != ".json":
                raise InputError(
                    f"file {str(path)!r}: must be a file name that ends with .json, without a folder"
                )
            if path.exists():
                raise InputError(f"file {str(path)!r}: exists already; choose another name")
            law, weather = self.laws["B"], self.weather
            tuning.save(weather, law, path, tuning.command_of(weather, self.laws["A"], law))
        except (InputError, OSError) as error:
            self._say(saved=f"<span class=bad>{html.escape(str(error))}</span>")
            return
        words = f"fowt evaluate --suite above_rated --controllers gspi_oc3,design:{path}"
        self._say(saved=f"wrote {html.escape(str(path))}; next:<br><code>{html.escape(words)}</code>")

    # computing

    def request(self) -> None:
        """Ask for new figures of the present weather and laws; an older request that is not done ends."""
        self.began = perf_counter()
        with self.lock:
            self.number += 1
            self.wake.set()
            if self.is_busy:
                return
            self.is_busy = True
        executor.submit(self._work)

    def _work(self):
        """Compute in the worker thread until the newest request is answered."""
        while True:
            self.wake.clear()
            number, began = self.number, self.began
            weather, laws, count = self.weather, dict(self.laws), int(self.count.value)
            try:
                for part in self._parts(weather, laws, count):
                    self.doc.add_next_tick_callback(part)
                    if self.number != number:
                        break
            except Exception as error:  # of a user's controller, or of conditions that cannot be built
                self.doc.add_next_tick_callback(partial(self._fail, error))
            with self.lock:
                if self.number == number:
                    self.is_busy = False
                    if self.doc.session_context is None or not self.doc.session_context.destroyed:
                        self.doc.add_next_tick_callback(partial(self._finish, perf_counter() - began))
                    return

    def _parts(self, weather: Weather, laws: dict[str, Law], count: int):
        """Yield functions that show one part of the figures each, in the order of their computing."""
        pictures = {side: tuning.picture(weather, laws[side]) for side in reversed(SIDES)}
        yield partial(self._show_pictures, weather, pictures)
        if self.wake.wait(PAUSE):  # a slider that still moves has only its picture redrawn
            return
        figures = {side: [tuning.figures(weather, laws[side])] for side in SIDES}
        yield partial(self._show_table, laws, tuning.paired(figures["A"], figures["B"]), 1)
        yield partial(self._show, "spectra", {side: tuning.spectra(weather, laws[side]) for side in SIDES})
        yield partial(
            self._show, "responses", {side: tuning.responses(weather, laws[side]) for side in SIDES}
        )
        yield partial(self._show_loops, {side: tuning.linear(weather, laws[side]) for side in SIDES})
        for other in tuning.further_seeds(weather, count)[1:]:
            for side in SIDES:
                figures[side].append(tuning.figures(other, laws[side]))
            yield _nothing
        if count > 1:
            yield partial(self._show_table, laws, tuning.paired(figures["A"], figures["B"]), count)

    # showing

    def _show(self, kind, data):
        for side in SIDES:
            self.sources[kind][side].data = data[side]

    def _show_pictures(self, weather, pictures):
        shape = json.dumps(_shape(weather))
        if self.sources["shape"]["A"].data["json"][0] != shape:
            self.sources["shape"]["A"].data = {"json": [shape]}
        changed = [side for side in SIDES if self.shown.get(side) is not pictures[side]]
        self._set_axes(weather, pictures)
        series, shown = pictures["B"].series, self.weather_source.data
        if any(not np.array_equal(series[name], shown[name]) for name in shown):
            self.weather_source.data = {name: series[name] for name in shown}
        for kind, names in self.packed.items():
            for side in changed:
                packed = _packed(getattr(pictures[side], kind), names)
                self.sources[f"packed {kind}"][side].data = {"values": packed}
        self.shown = pictures
        self.notes = "; ".join(f"{side}: {pictures[side].note}" for side in SIDES if pictures[side].note)

    def _set_axes(self, weather, pictures):
        """Set the ranges of the time series that do not fit their curves."""
        end = weather.duration
        if self.time_axis.reset_end != end:
            self.time_axis.update(start=0.0, end=end, reset_start=0.0, reset_end=end)
        for name, axis in self.axes.items():
            curves = [each.series[name] for each in pictures.values() if len(each.series.get(name, ()))]
            found = fitting(np.concatenate(curves), axis.start, axis.end) if curves else None
            if found not in (None, (axis.start, axis.end)):
                start, end = found
                axis.update(start=start, end=end, reset_start=start, reset_end=end)

    def _show_table(self, laws, ratios, count):
        names = {side: html.escape(str(laws[side])) for side in SIDES}
        seeds = "one seed" if count == 1 else f"{count} seeds"
        words = html.escape(tuning.verdict(ratios, count))
        verdict = f"<b>B</b> {names['B']} against <b>A</b> {names['A']}, {seeds}: {words}"
        rows = []
        for name, ratio in ratios.items():
            change = 100.0 * (ratio.ratio - 1.0)
            kind = (
                "" if count > 3 and not ratio.is_sure else "better" if better(name) * change > 0 else "worse"
            )
            span = f"{ratio.low:.3f} to {ratio.high:.3f}" if np.isfinite(ratio.low) else "–"
            words = SHORT.get(name, short_name(name))
            cells = (
                f"<td title='{html.escape(about_metric(name), quote=True)}'>{words} <span class=soft>"
                f"{name.partition('_[')[2].rstrip(']')}</span></td>"
                f"<td>{number_text(ratio.first)}</td><td>{number_text(ratio.second)}</td>"
                f"<td class='{kind}'>{percent_text(change)}{'*' if ratio.is_sure else ''}</td><td>{span}</td>"
            )
            rows.append(f"<tr>{cells}</tr>")
        head = f"<tr><th>{seeds}</th><th>A</th><th>B</th><th>B / A</th><th>95 % interval</th></tr>"
        table = f"<table>{head}{''.join(rows)}</table>" if rows else "no figures: a run ended early"
        command = html.escape(tuning.command_of(self.weather, laws["A"], laws["B"]))
        status = f"<span class=bad>{html.escape(self.notes)}</span>" if self.notes else "computing ..."
        self._say(verdict=verdict, table=table, command=command, status=status)

    def _show_loops(self, loops):
        for side in SIDES:
            poles = loops[side].poles
            poles = poles[(poles.imag >= 0.0) & (np.abs(poles) < 3.0)]
            self.sources["poles"][side].data = {"real": poles.real, "imaginary": poles.imag}
        both = zip(*(tuning.loop_words(loops[side]) for side in SIDES), strict=True)
        texts = [(key, first, second) for (key, first), (_, second) in both]
        body = "".join(
            f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in cells)}</tr>" for cells in texts
        )
        self._say(loops=f"<table><tr><th>linear loop</th><th>A</th><th>B</th></tr>{body}</table>")

    def _finish(self, seconds):
        if not self.notes:
            self._say(status=f"all figures in {1e3 * seconds:.0f} ms")

    def _fail(self, error):
        text = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        self.notes = text
        self._say(status=f"<span class=bad>{html.escape(text)}</span>")


def _nothing():
    """Show nothing: a point at which a newer request ends the work."""


def fitting(values: np.ndarray, start: float, end: float) -> tuple[float, float]:
    """Return the range of an axis for curves: the present one if they fill FILLED of it, else round ends."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if start <= low and high <= end and high - low >= FILLED * (end - start):
        return start, end
    step = _step(low, max(high, low + 1e-6 * max(1.0, abs(low))), 10.0)
    return float(step * np.floor(low / step)), float(step * np.ceil(high / step))


def _packed(columns, names):
    """Return columns one after another in single precision, which is one message to the page."""
    missing = np.full_like(columns["time"], np.nan)
    return np.concatenate([columns.get(name, missing) for name in names], dtype=np.float32)


def _carrier(name, *sources):
    """Return an invisible root that brings sources to the page, which no figure uses."""
    return Div(text="", visible=False, name=name, tags=list(sources))


def _platforms(weather):
    known = platform_names()
    return known if weather.platform in known else [*known, weather.platform]


def _speed(wind):
    """Return the mean speed in the text of a wind, m/s, or None for a wind without one."""
    return parse_number(wind) if ":" not in wind else parse_number((wind.split(":") + [""])[1])


def _with_speed(wind, speed):
    """Return the text of a wind with another mean speed."""
    parts = wind.split(":")
    parts[0 if len(parts) == 1 else 1] = f"{speed:g}"
    return ":".join(parts)


def _step(low, high, parts=100.0):
    """Return a round step of about that part of a range."""
    size = (high - low) / parts
    decade = 10.0 ** np.floor(np.log10(size))
    return float(decade * min((1.0, 2.0, 5.0, 10.0), key=lambda factor: abs(factor - size / decade)))


def _format(step):
    return "0[.]" + "0" * max(0, int(np.ceil(-np.log10(step))) + 1)


def _shape(weather):
    """Return what the page's script needs to draw the turbine to scale: outlines in body axes, m."""
    scene = weather.scene()
    platform, turbine = scene.platform, scene.turbine
    rotor, tower, blade = turbine.rotor, platform.tower, turbine.blade
    members = [
        {"ends": np.round(ends, 3).tolist(), "widths": [float(size[0]), float(size[1])] if is_round else
         [float(size[1])] * 2}
        for ends, size, is_round in solids(platform)
    ]  # fmt: skip
    tip = rotor.tip_radius
    return {
        "members": members,
        "tower": [tower.base_height, tower.top_height, tower.base_diameter, tower.top_diameter],
        "hub": [-rotor.overhang, rotor.hub_height], "radius": tip, "blades": rotor.blades,
        "blade": [[float(r), float(c)] for r, c in zip(blade.radius, blade.chord, strict=True)],
        "shift": DEPTH_SHIFT,
    }  # fmt: skip


def application(
    weather: Weather, laws: Sequence[Law], further: Sequence[str] = ()
) -> Callable[[Document], Any]:
    """Return the function that fills a document of Bokeh with a new Page."""
    return lambda doc: Page(doc, weather, laws, further)
