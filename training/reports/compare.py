"""Compares two runs channel by channel: statistics, fatigue loads, spectra, lags, and their usual causes."""

import re
from math import inf, nan
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.signal import butter, coherence, sosfiltfilt, welch

from fowt_env.errors import InputError, did_you_mean
from fowt_env.plant.channels import UNITS
from fowt_env.training.evaluation.metrics import (
    BLADE_EXPONENT,
    CHAIN_EXPONENT,
    TOWER_EXPONENT,
    damage_equivalent_load,
)
from fowt_env.visual.style import INK, head, line_style, new_figure, save_figure, style_axes
from fowt_env.visual.time_series import even_step, spectrum

TIME = "Time_[s]"
SPELLED = {  # other names of a channel in OpenFAST's versions and modules
    "PtfmTDxi": "PtfmSurge", "PtfmTDyi": "PtfmSway", "PtfmTDzi": "PtfmHeave", "PtfmRDxi": "PtfmRoll",
    "PtfmRDyi": "PtfmPitch", "PtfmRDzi": "PtfmYaw", "BlPitch1": "BldPitch1", "BlPitch2": "BldPitch2",
    "BlPitch3": "BldPitch3", "RtAeroFxh": "RtFldFxh", "RtAeroMxh": "RtFldMxh", "WaveElev": "Wave1Elev",
    "WindVxi": "Wind1VelX", "WindVyi": "Wind1VelY", "WindVzi": "Wind1VelZ",
}  # fmt: skip
UNIT_WORDS = {"sec": "s", "m/sec": "m/s", "m/s2": "m/s^2", "m/sec^2": "m/s^2", "kN·m": "kN-m", "N·m": "N-m"}
KINDS = (("N", "kN"), ("N-m", "kN-m"), ("deg",), ("deg/s",), ("deg/s^2",), ("rpm",), ("kW",))  # convertible
CONTROLLED = r"BldPitch|GenTq|GenPwr"
INPUTS = ("Wind1VelX", "Wave1Elev")
SHOWN = (  # panels of the plot, where both runs have the channel
    "Wind1VelX", "Wave1Elev", "RotSpeed", "BldPitch1", "GenTq", "GenPwr", "RotThrust", "PtfmPitch",
    "PtfmSurge", "PtfmHeave", "TwrBsMyt", "RootMyc1", "FAIRTEN1",
)  # fmt: skip
MOST_PANELS, HIGHEST = 8, 2.0  # Hz, end of the spectra in the plot
SLOW, FAST = 0.04, 0.25  # Hz, edges between the bands of platform modes, waves, and rotor and structure
BANDS = (f"below {SLOW} Hz", f"{SLOW} to {FAST} Hz", f"above {FAST} Hz")
LONGEST_LAG = 30.0  # s
TIE = 1e-9  # difference of correlations that is rounding: the smaller lag then counts
CONSTANT = 1e-6  # of the largest value: a range below is rounding
MEAN, DEVIATION, FATIGUE, ALIKE = 0.02, 0.05, 0.05, 0.9  # differences from which a note is made
PHASE = 0.01  # of the period of a channel's spectral peak: a shorter lag of a motion or load is not a note
FACTORS = {  # ratios of the two series: what differs
    1e3: "a factor of 1000 (kN and N, MW and kW)", 180.0 / np.pi: "degrees and radians",
    30.0 / np.pi: "rpm and rad/s", 97.0: "the two sides of a gearbox of 97:1",
}  # fmt: skip


class Row(NamedTuple):
    """Holds the comparison of one channel; a quantity that is not defined is NaN."""

    channel: str
    unit: str
    mean: float
    mean_other: float
    std: float
    std_other: float
    del_1hz: float  # 1 Hz damage-equivalent load
    del_1hz_other: float
    exponent: float  # inverse slope of its S-N curve
    peak: float  # Hz, of the spectrum
    peak_other: float
    correlation: float  # largest, at the lag
    lag: float  # s by which the first run is later than the second
    coherence: float  # mean over frequency, weighted by the spectrum of the second run
    smallest: float
    smallest_other: float
    largest: float
    largest_other: float


class Comparison(NamedTuple):
    """Holds the comparison of two runs."""

    rows: list[Row]
    notes: list[tuple[str, str]]  # (channels, what differs and what usually causes it)
    only: tuple[list[str], list[str]]  # channels of one run alone
    window: tuple[float, float]  # s, compared
    steps: tuple[float, float]  # s, of the runs
    pairs: dict  # channel: (time, first run, second run), on a common grid

    def table(self) -> pd.DataFrame:
        """Return the rows as a DataFrame, with ratios in %."""
        frame = pd.DataFrame(self.rows)
        frame["std_difference_[%]"] = 100.0 * (frame["std"] / frame["std_other"] - 1.0)
        frame["del_difference_[%]"] = 100.0 * (frame["del_1hz"] / frame["del_1hz_other"] - 1.0)
        return frame


def compare(mine, theirs, start=None, end=None, channels=()) -> Comparison:
    """Compare two runs (DataFrames with OpenFAST's column names, evenly spaced) in their common time.

    start, end: s, limits of the compared time; channels: names without units, (): all in common.
    Means, deviations, extremes and fatigue loads are those of each run's own samples; correlation, lag,
    coherence are of both on the larger of their steps, after a low pass of the finer run.
    Raises: InputError for runs without common time or channels, and for unknown channels.
    """
    frames = [_named(frame, which) for frame, which in ((mine, "the first run"), (theirs, "the second run"))]
    common = [name for name in frames[0] if name in frames[1] and name != TIME]
    names = [name.partition("_[")[0] for name in common]
    for name in channels:
        if name not in names:
            hint = did_you_mean(name, names)
            raise InputError(f"channel {name!r}: is not in both runs.{hint} In both: {', '.join(names)}")
    if channels:
        common = [column for column, name in zip(common, names, strict=True) if name in channels]
    if not common:
        raise InputError("the runs have no channel of the same name and unit")
    low = max(frame[TIME].iloc[0] for frame in frames)
    high = min(frame[TIME].iloc[-1] for frame in frames)
    low, high = max(low, low if start is None else start), min(high, high if end is None else end)
    cut = [frame[(frame[TIME] >= low - 1e-6) & (frame[TIME] <= high + 1e-6)] for frame in frames]
    if min(map(len, cut)) < 16:
        spans = " and ".join(f"{f[TIME].iloc[0]:g} to {f[TIME].iloc[-1]:g} s" for f in frames)
        asked = f"from {low if start is None else start:g} to {high if end is None else end:g} s"
        raise InputError(f"{asked}: fewer than 16 common rows; the runs cover {spans}")
    steps = tuple(
        even_step(which, frame[TIME].to_numpy())
        for which, frame in zip(("first", "second"), cut, strict=True)
    )
    pairs = {column: _pair(cut, steps, column) for column in common}
    rows = [_row(cut, steps, column, pairs[column]) for column in common]
    only = tuple([c.partition("_[")[0] for c in a if c not in b] for a, b in (frames, frames[::-1]))
    return Comparison(rows, _notes(rows, pairs), only, (float(low), float(high)), steps, pairs)


def _named(frame, which):
    """Return a run with columns by fowt_env's spelling of names and units."""
    renamed = {}
    for column in frame.columns:
        name, sign, unit = str(column).partition("_[")
        unit = unit.rstrip("]")
        name, unit = SPELLED.get(name, name), UNIT_WORDS.get(unit, unit)
        for kind in KINDS:  # the larger unit of each kind
            if unit in kind and unit != kind[-1]:
                frame = frame.assign(**{column: frame[column] * UNITS[kind[-1]] / UNITS[unit]})
                unit = kind[-1]
        new = f"{name}_[{unit}]" if sign else str(column)
        if new not in frame.columns or new == column:
            renamed[column] = new
    frame = frame.rename(columns=renamed)
    if TIME not in frame.columns or len(frame) < 2:
        raise InputError(f"{which}: needs a column {TIME!r} and at least two rows")
    return frame.astype(np.float64)


def _pair(frames, steps, column):
    """Return (time, first, second) of a channel at the larger step of the two runs."""
    coarse = max(steps)
    low = max(frame[TIME].iloc[0] for frame in frames)
    high = min(frame[TIME].iloc[-1] for frame in frames)
    time = low + coarse * np.arange(int((high - low) / coarse + 1e-6) + 1)
    series = []
    for frame, step in zip(frames, steps, strict=True):
        values = frame[column].to_numpy()
        if step < 0.99 * coarse and np.isfinite(values).all() and len(values) > 60:
            values = sosfiltfilt(butter(4, 0.8 * step / coarse, output="sos"), values)  # no aliases
        series.append(np.interp(time, frame[TIME].to_numpy(), values))
    return time, *series


def exponent_of(name, unit):
    """Return the inverse slope of the S-N curve of a load by name and unit of its channel; NaN: no load."""
    if unit not in ("kN", "kN-m") or re.match(r"Hydro|Rt(Fld|Aero)|Gen|Wave|Wind|B\d*Hydro", name):
        return nan
    if re.match(r"(Root|Spn\d)", name):
        return BLADE_EXPONENT
    if re.match(r"(FAIRTEN|ANCHTEN|Fair\d|Anch\d|T\[|Con\d|L\d)", name, re.I):
        return CHAIN_EXPONENT
    return TOWER_EXPONENT


def _varies(values):
    """Return whether a series is finite and varies by more than rounding."""
    return bool(np.isfinite(values).all() and np.ptp(values) > CONSTANT * np.abs(values).max())


def _row(frames, steps, column, pair):
    """Return the Row of a channel."""
    name, unit = column.rstrip("]").split("_[")
    own = [frame[column].to_numpy() for frame in frames]
    exponent = exponent_of(name, unit)
    fatigue, peaks = [nan, nan], [nan, nan]
    for i, (frame, values) in enumerate(zip(frames, own, strict=True)):
        length = frame[TIME].iloc[-1] - frame[TIME].iloc[0]
        if np.isfinite(exponent):
            fatigue[i] = damage_equivalent_load(values, length, exponent)
        if _varies(values):
            frequency, density = spectrum(frame[TIME], values)
            peaks[i] = float(frequency[1 + np.argmax(density[1:])])
    correlation, lag, alike = nan, nan, nan
    if all(map(_varies, pair[1:])) and name != "Azimuth":  # that wraps
        correlation, lag = _lag(*pair)
        alike = _coherence(*pair)
    means, deviations = [float(np.mean(x)) for x in own], [float(np.std(x)) for x in own]
    ends = [float(end(x)) for end in (np.min, np.max) for x in own]
    return Row(name, unit, *means, *deviations, *fatigue, exponent, *peaks, correlation, lag, alike, *ends)


def _lag(time, first, second):
    """Return (correlation at the lag, lag s) of the first series behind the second.

    The lag of the largest absolute correlation within LONGEST_LAG and a quarter of the record, refined by a
    parabola.
    """
    step, n = time[1] - time[0], len(time)
    most = int(min(LONGEST_LAG / step, n // 4))
    a, b = first - first.mean(), second - second.mean()
    size = 1 << (2 * n - 1).bit_length()
    shifts = np.arange(-most, most + 1)
    product = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)[shifts]
    # of the parts that overlap at a shift, as a slow series is not stationary over a record
    count = n - np.abs(shifts)
    ends = [(np.maximum(s, 0), np.minimum(n + s, n)) for s in (shifts, -shifts)]
    sums, powers = [], []
    for values, (low, high) in zip((a, b), ends, strict=True):
        for parts, power in ((sums, values), (powers, values**2)):
            total = np.concatenate(([0.0], np.cumsum(power)))
            parts.append(total[high] - total[low])
    spreads = [power - part**2 / count for part, power in zip(sums, powers, strict=True)]
    value = (product - sums[0] * sums[1] / count) / np.sqrt(np.maximum(spreads[0] * spreads[1], 1e-300))
    best = np.flatnonzero(np.abs(value) >= np.abs(value).max() - TIE)
    at = int(best[np.argmin(np.abs(shifts[best]))])  # a decay, for one, is like itself at any shift
    lag = float(shifts[at])
    if 0 < at < len(shifts) - 1:
        left, middle, right = np.abs(value[at - 1 : at + 2])
        bend = left - 2.0 * middle + right
        lag += 0.5 * (left - right) / bend if bend < -TIE else 0.0
    return float(np.clip(value[at], -1.0, 1.0)), lag * step


def _coherence(time, first, second):
    """Return the coherence of two series, averaged with the spectrum of the second as weight."""
    rate, samples = 1.0 / (time[1] - time[0]), max(16, len(time) // 8)
    _, value = coherence(first, second, rate, nperseg=samples)
    _, density = welch(second, rate, nperseg=samples)
    return float(np.average(value, weights=density)) if density.sum() > 0.0 else nan


def band_variances(time, values):
    """Return the variances (3,) of a series in the BANDS."""
    frequency, density = spectrum(time, values)
    edges = np.digitize(frequency, (SLOW, FAST))
    return np.array([density[edges == band].sum() for band in range(3)]) * (frequency[1] - frequency[0])


FAMILIES = (  # names of channels: (cause of another mean, causes of other variance in each band)
    (
        r"RotThrust|RotTorq|RtFld|RtVAvg|LSShft|LSSTip",
        "wake and skew model, tip loss, polars, tilt and cone of the rotor, or blades that bend and twist",
        (
            "wind, or the control law",
            "motion of the platform, or wake that lags (dynamic inflow)",
            "rotational sampling of full-field wind, tower shadow, dynamic stall or flexible blades",
        ),
    ),
    (
        r"RotSpeed|GenSpeed|BldPitch|GenTq|GenPwr",
        "gains, set points and torque law of the controller, efficiency of the generator (mechanical or"
        " electrical power), or the aerodynamic torque",
        (
            "gains or filters of the controller, or the wind",
            "gains, filters and lag of the pitch drive, or the motion of the platform",
            "1P and 3P in full-field wind, drivetrain torsion, or filters of the generator speed",
        ),
    ),
    (
        r"Ptfm",
        "thrust and torque of the rotor, wind shear, mooring stiffness and pretension, weights and their"
        " centres, or mean drift of the waves",
        (
            "wind, second-order wave loads, linear damping, mooring, or the controller (negative damping)",
            "wave loads: components, stretching, drag, strips or potential flow",
            "modes of the tower, or a time step that is too long",
        ),
    ),
    (
        r"TwrBs|YawBr|TTDsp|NcIMU|TwHt",
        "thrust, wind shear, weight of the rotor-nacelle assembly, or the height of the section",
        (
            "wind, or the motion of the platform",
            "wave loads, the motion of the platform, or a flexible tower, which amplifies both",
            "a flexible tower (fowt_env: tower='modes2'), flexible blades, or 3P of full-field wind",
        ),
    ),
    (
        r"Root|Spn",
        "wake model, polars, or blades that bend and twist",
        (
            "wind, or the control law",
            "gravity and shear at 1P, or the motion of the platform",
            "flexible blades (fowt_env: rigid), dynamic stall, or full-field wind",
        ),
    ),
    (
        r"FAIRTEN|ANCHTEN|Fair\d|Anch\d",
        "pretension, weight and length of the lines, or the offset of the platform",
        (
            "slow drift of the platform",
            "line dynamics (MoorDyn) against quasi-static lines (MAP++, fowt_env), or the wave loads",
            "line dynamics (MoorDyn) against quasi-static lines (MAP++, fowt_env)",
        ),
    ),
)


def _notes(rows, pairs):
    """Return [(channels, text)] of what differs, equal texts together."""
    known = {row.channel: row for row in rows}
    found = {}
    different = [name for name in INPUTS if name in known and _differs(known[name])]
    shifts = [known[name].lag for name in INPUTS if name in known and abs(known[name].correlation) >= ALIKE]
    shift = float(np.median(shifts)) if shifts else 0.0
    for (column, pair), row in zip(pairs.items(), rows, strict=True):
        for text in _texts(row, pair, known, different, shift):
            found.setdefault(text, []).append(column.partition("_[")[0])
    return [(", ".join(names), text) for text, names in found.items()]


def _differs(row):
    """Return whether the series of a channel are not the same apart from a shift and a factor."""
    return np.isfinite(row.correlation) and row.correlation < ALIKE


def _texts(row, pair, known, different, shift):
    """Yield what differs in a channel, each with what usually causes it."""
    time, first, second = pair
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        yield "not finite in one of the runs: it failed, or the module was off"
        return
    scale = max(abs(row.mean_other), row.std_other)
    varies = [_varies(values) for values in (first, second)]
    if varies[0] != varies[1]:
        which = "second" if varies[1] else "first"
        yield f"varies in the {which} run only: usually a degree of freedom or load that the other lacks"
        return
    factor = _factor(row)
    if factor:
        yield f"differs by {factor}: units"
        return
    if row.correlation < -ALIKE:
        yield "has the opposite sign: usually another sign convention, axis or direction of rotation"
        return
    if row.channel in INPUTS and row.channel in different:
        what = "wind" if row.channel.startswith("Wind") else "waves"
        yield (
            f"is another series (correlation {row.correlation:.2f}): other {what}; equal seeds draw other"
            " phases in each code. Statistics can be compared, series cannot"
        )
        return
    step = time[1] - time[0]
    least = 0.75 * step
    if not re.match(CONTROLLED, row.channel) and row.channel not in INPUTS:
        least = max(least, PHASE / row.peak_other)
    if different:  # equal in statistics at best
        least = inf
    if abs(row.lag) > least and row.correlation >= ALIKE:
        yield _lag_text(row, known, shift, step)
    if not different and scale > 0.0 and _starts_apart(first, second, scale):
        yield (
            "differs far more in the first quarter of the time than later: an initial transient, usually"
            " other initial conditions; leave it out (--from)"
        )
    if row.channel in INPUTS:
        if varies[1] and abs(row.std / row.std_other - 1.0) > DEVIATION:
            yield (
                "has another deviation: usually a rotor average against a point, another height, or a"
                " spectrum cut at another frequency"
            )
        return
    causes = next((each for each in FAMILIES if re.match(each[0], row.channel)), None)
    if causes is None or not any(varies) and scale == 0.0:
        return
    if abs(row.mean - row.mean_other) > MEAN * scale:
        yield f"has another mean: usually {causes[1]}"
    if all(varies) and abs(row.std / row.std_other - 1.0) > DEVIATION:
        mine, other = band_variances(time, first), band_variances(time, second)
        band = int(np.argmax(np.abs(mine - other)))
        more = "first" if mine[band] > other[band] else "second"
        yield f"varies more in the {more} run, mostly {BANDS[band]}: usually {causes[2][band]}"
    elif np.isfinite(row.del_1hz) and row.del_1hz_other > 0.0:
        if abs(row.del_1hz / row.del_1hz_other - 1.0) > FATIGUE:
            yield (
                "has the same deviation and another fatigue load: usually content at high frequency, or the"
                " output step (a longer one misses peaks)"
            )


def _factor(row):
    """Return the words of a known factor between the series of a channel, None without one."""
    if row.std == 0.0 or row.std_other == 0.0 or abs(row.correlation) < 0.98:
        return None
    ratio = row.std / row.std_other
    for factor, words in FACTORS.items():
        if abs(ratio / factor - 1.0) < 0.02 or abs(ratio * factor - 1.0) < 0.02:
            return words
    return None


def _lag_text(row, known, shift, step):
    """Return the note on a lag; shift: that of wind and waves, s."""
    side = "later" if row.lag > 0.0 else "earlier"
    what = f"comes {abs(row.lag):.2g} s {side} in the first run: usually"
    if row.channel in INPUTS:
        return (
            f"{what} the start of a turbulence box (OpenFAST reads it half a grid width ahead) or of the wave"
            " series"
        )
    if abs(shift) > 0.75 * step and abs(row.lag - shift) <= step:
        return f"comes {side} as the wind or waves do: align these first"
    if re.match(CONTROLLED, row.channel):
        speed = known.get("GenSpeed") or known.get("RotSpeed")
        if speed is not None and abs(row.lag - speed.lag) <= 0.75 * step:
            return f"comes {side} as the rotor speed does: the cause is in the plant or the wind"
        return (
            f"{what} the lag of the pitch drive or converter, the control period, or a filter of the"
            " generator speed"
        )
    return (
        f"comes {side} in the first run: usually another natural frequency, or an initial offset that decays"
    )


def _starts_apart(first, second, scale):
    """Return whether the difference of two series is mostly in the first quarter."""
    error, quarter = first - second, len(first) // 4
    early, late = (np.sqrt(np.mean(part**2)) for part in (error[:quarter], error[-2 * quarter :]))
    return early > 3.0 * late and early > 0.1 * scale


def plot_comparison(comparison, names, path=None, title=None, channels=()):
    """Plot series (left) and power spectral densities (right) of two runs; return the Figure.

    names: labels of the runs; channels: names without units, (): the usual ones, at most MOST_PANELS.
    """
    columns = {column.partition("_[")[0]: column for column in comparison.pairs}
    shown = [name for name in channels or SHOWN if name in columns] or list(columns)
    shown = shown if channels else shown[:MOST_PANELS]
    figure = new_figure(11.0, 0.9 + 1.45 * len(shown))
    grid = figure.subplots(len(shown), 2, squeeze=False, width_ratios=(2, 1), sharex="col")
    for (left, right), name in zip(grid, shown, strict=True):
        column = columns[name]
        time, *series = comparison.pairs[column]
        unit = column.rstrip("]").partition("_[")[2]
        for number, values in enumerate(series):
            style = line_style(number) | {"linestyle": ("-", "--")[number]}
            left.plot(time, values, linewidth=0.9, **style)
            if _varies(values):
                frequency, density = spectrum(time, values)
                right.loglog(frequency[1:], density[1:], linewidth=0.9, **style)
        style_axes(left, ylabel=f"{name}\n({unit})")
        squared = f"{unit}²" if unit.isalpha() else f"({unit})²"
        style_axes(right, ylabel=f"{squared}/Hz")
        left.margins(x=0.0)
        left.ticklabel_format(axis="y", useOffset=False)
        if right.lines:
            top = max(line.get_ydata().max() for line in right.lines)
            right.set_ylim(top * 1e-7, top * 4.0)
            right.set_xlim(right=min(0.5 / max(comparison.steps), HIGHEST))
    grid[-1, 0].set_xlabel("time (s)", fontsize=9, color=INK)
    grid[-1, 1].set_xlabel("frequency (Hz)", fontsize=9, color=INK)
    figure.align_ylabels(grid[:, 0])
    head(figure, title, grid[0, 0].lines[:2], names)
    return save_figure(figure, path)
