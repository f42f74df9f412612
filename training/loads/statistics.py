"""Computes the statistics of one run of a design load table from its output channels.

Extremes with time and simultaneous loads, moments, rainflow cycles, peaks for extrapolation, and constraints:
some tens of kB instead of a time series of 15 MB. Loads keep OpenFAST's names, axes, signs and units.
"""

import json
from dataclasses import dataclass, field
from math import inf, log2, nan
from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.files import parse_json
from fowt_env.descriptions.ratings import ratings
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import entry
from fowt_env.training.evaluation.metrics import TIME, TOWER_TOP_ACCELERATION_LIMIT

FORMAT = 1  # of the stored statistics
EXPONENTS = (3, 4, 6, 8, 10, 12)  # inverse slopes m of S-N curves, those of IEA-22's design load tables
DIRECTIONS = (30, 60, 120, 150)  # deg, of bending moments between the axes of their two channels
BINS = 64  # at most, of ranges and of means of a stored rainflow matrix
PEAK_LEVEL = 1.4  # standard deviations above the mean, threshold of peaks as in IEC 61400-1, annex on
# statistical extrapolation (public: Moriarty, Holley and Butterfield 2004, NREL/TP-500-34421)
PEAK_SEPARATION = 10.0  # s: peaks that are closer belong to one event, as within a wave or a gust
MOST_PEAKS = 60  # of a run, the largest ones
SLACK = 0.1  # of the mean tension: less than this is a slack line (snap criterion of DNV-RP-H103, 2011, that
# the dynamic tension is at most 0.9 of the static one)

# loads whose values at the extreme of one are kept for all; {} is the number of a blade
GROUPS = {
    "tower base": ("TwrBsFxt", "TwrBsFyt", "TwrBsFzt", "TwrBsMxt", "TwrBsMyt", "TwrBsMzt"),
    "yaw bearing": ("YawBrMxp", "YawBrMyp", "YawBrMzp"),
    "shaft": (
        "RotThrust", "RotTorq", "LSSTipMys", "LSSTipMzs", "LSSTipMya", "LSSTipMza", "LSShftFys", "LSShftFzs",
        "LSShftFya", "LSShftFza",
    ),
    "blade root {}": (
        "RootFxc{}", "RootFyc{}", "RootFzc{}", "RootMxc{}", "RootMyc{}", "RootMzc{}", "RootMxb{}",
        "RootMyb{}", "BldPitch{}",
    ),
    "blade {}": (
        "Spn1MLxb{}", "Spn1MLyb{}", "Spn2MLxb{}", "Spn2MLyb{}", "OoPDefl{}", "IPDefl{}", "TipDxb{}",
        "TipDyb{}",
    ),
    "platform": (
        "PtfmSurge", "PtfmSway", "PtfmHeave", "PtfmRoll", "PtfmPitch", "PtfmYaw", "NcIMUTAxs", "NcIMUTAys",
        "TTDspFA", "TTDspSS",
    ),
    "operation": ("RotSpeed", "GenSpeed", "GenTq", "GenPwr"),
}  # fmt: skip
BLADES = (1, 2, 3)
MOORING = "mooring"
LINES = ("FAIRTEN", "ANCHTEN")
# what the turbine and the weather do at the time of an extreme
CONDITIONS = ("Wind1VelX", "Wave1Elev", "RotSpeed", "BldPitch1", "Azimuth", "PtfmPitch", "PtfmSurge")
RESULTANTS = {  # channels that are added: name, its group, and the two perpendicular components
    "TwrBsMxyt": ("tower base", "TwrBsMxt", "TwrBsMyt"),
    "YawBrMxyp": ("yaw bearing", "YawBrMxp", "YawBrMyp"),
    "LSSTipMyzs": ("shaft", "LSSTipMys", "LSSTipMzs"),
    **{f"RootMxyc{i}": (f"blade root {i}", f"RootMxc{i}", f"RootMyc{i}") for i in BLADES},
    **{f"RootMxyb{i}": (f"blade root {i}", f"RootMxb{i}", f"RootMyb{i}") for i in BLADES},
    "NcIMUTAxys": ("platform", "NcIMUTAxs", "NcIMUTAys"),
    "PtfmOffset": ("platform", "PtfmSurge", "PtfmSway"),
    "PtfmTilt": ("platform", "PtfmRoll", "PtfmPitch"),
}
ROSES = {  # bending moments by direction: moments at 0 and 90 deg; of the first pair that a run has
    "Tower base": (("TwrBsMxt", "TwrBsMyt"),),
    "Yaw bearing": (("YawBrMxp", "YawBrMyp"),),
    "Main bearing": (("LSSTipMya", "LSSTipMza"), ("LSSTipMys", "LSSTipMzs")),
    **{f"Blade {i} root": ((f"RootMxb{i}", f"RootMyb{i}"), (f"RootMxc{i}", f"RootMyc{i}")) for i in BLADES},
}
_STRUCTURE = ("tower base", "yaw bearing", "shaft", "blade root {}", "blade {}")
FATIGUE_LOADS = frozenset(
    name.format(i)
    for group in _STRUCTURE
    for name in GROUPS[group]
    for i in BLADES
    if "Defl" not in name and "Tip" not in name.removeprefix("LSS") and "Pitch" not in name
)
# channels of which a value of 50 years may be asked for: peaks are kept
EXTRAPOLATED = frozenset(
    (
        "TwrBsMxt", "TwrBsMyt", "TwrBsMxyt", "YawBrMyp", "YawBrMzp", "LSSTipMys", "LSSTipMzs", "RotThrust",
        "RotTorq", "PtfmPitch", "PtfmRoll", "PtfmTilt", "PtfmOffset", "NcIMUTAxs", "RotSpeed",
        *(f"{name}{i}" for name in ("RootMxc", "RootMyc", "RootMxb", "RootMyb", "OoPDefl") for i in BLADES),
    )
)  # fmt: skip
LIMITS = {  # of constraints, unless the designer has others; None: no limit, only the value
    "overspeed": 1.2,  # of rated rotor speed, as in the IEA-15 and IEA-22 optimisations of WEIS
    "platform pitch": 7.0,  # deg from the vertical, as there
    "nacelle acceleration": TOWER_TOP_ACCELERATION_LIMIT,  # m/s2
    "air gap": 0.0,  # m, least
    "slack line": SLACK,  # of the mean tension, least
    "line tension": None,  # kN
    "offset": None,  # m
}
LEAST_IS_WORST = ("air gap", "slack line")


class Flag(NamedTuple):
    """Holds the worst value of a constraint in a run, its time and its limit; a limit of None never fails."""

    name: str
    value: float
    unit: str
    limit: float | None
    time: float  # s

    @property
    def exceeded(self):
        """Return whether the value is beyond the limit."""
        if self.limit is None or self.value != self.value:
            return False
        return self.value < self.limit if self.name in LEAST_IS_WORST else self.value > self.limit

    def worse_than(self, other):
        """Return whether the value is further towards or beyond the limit than that of another Flag."""
        return self.value < other.value if self.name in LEAST_IS_WORST else self.value > other.value


@dataclass(frozen=True)
class Cycles:
    """Holds rainflow cycles of a channel: exact sums, and a matrix of half cycles over range and mean.

    Widths of the bins are powers of two, so that matrices of several runs have common edges: a bin i holds
    ranges in [i, i + 1) width, a bin j means in [j, j + 1) mean_width.
    """

    sums: np.ndarray  # (EXPONENTS,) sum of count times range^m
    count: float  # cycles
    width: float  # of ranges, unit of the channel
    mean_width: float
    cells: np.ndarray  # (n, 3) int32: i, j, number of half cycles


@dataclass(frozen=True)
class RunStatistics:
    """Holds the statistics of one run.

    channels     columns, OpenFAST names with units, resultants and directions included
    mean, std, min, max, time_min, time_max   (channels,); times in s of the run
    at           {column: {"min" or "max": {column: value}}} simultaneous values at the extremes of a load
    cycles       {column: Cycles} of forces and moments
    peaks        {column: {"min" or "max": (values in order of time, number of all peaks)}}; values of "min"
                 have their own sign; stored in single precision
    flags        constraints
    duration     s that are counted; start: time of the first counted row, s
    """

    channels: tuple
    mean: np.ndarray
    std: np.ndarray
    min: np.ndarray
    max: np.ndarray
    time_min: np.ndarray
    time_max: np.ndarray
    duration: float
    start: float
    at: dict = field(default_factory=dict)
    cycles: dict = field(default_factory=dict)
    peaks: dict = field(default_factory=dict)
    flags: tuple = ()

    def value(self, column, statistic):
        """Return a statistic of a channel, one of MOMENTS; NaN if the run lacks the channel."""
        if column not in self.channels:
            return nan
        return float(getattr(self, statistic)[self.channels.index(column)])

    def save(self, file):
        """Write the statistics to a path or an open binary file, as a compressed .npz without pickles."""
        names = {name: number for number, name in enumerate(self.channels)}
        rows, values = _flat_at(self.at, names)
        cells = [each.cells for each in self.cycles.values()]
        peaks = [(name, side, *found) for name, sides in self.peaks.items() for side, found in sides.items()]
        about = {
            "format": FORMAT, "channels": list(self.channels), "duration": self.duration, "start": self.start,
            "flags": [flag._asdict() for flag in self.flags],
            "cycles": [
                [name, each.count, each.width, each.mean_width, len(each.cells)]
                for name, each in self.cycles.items()
            ],
            "peaks": [[name, side, len(value), count] for name, side, value, count in peaks],
        }  # fmt: skip
        np.savez_compressed(
            file,
            about=np.array(json.dumps(_without_nan(about), allow_nan=False)),
            moments=np.array([getattr(self, name) for name in MOMENTS]),
            at_rows=rows, at_values=values,
            sums=np.array([c.sums for c in self.cycles.values()]).reshape(-1, len(EXPONENTS)),
            cells=np.concatenate([*cells, np.empty((0, 3), np.int32)]),
            peaks=np.concatenate([*(value for _, _, value, _ in peaks), np.empty(0)]).astype(np.float32),
        )  # fmt: skip

    @classmethod
    def load(cls, file):
        """Return the statistics of a path or file written by `save`. Raises: InputError for another one."""
        try:
            with np.load(file, allow_pickle=False) as data:
                return _loaded(cls, {name: data[name] for name in data.files})
        except (OSError, ValueError, KeyError, TypeError, IndexError, EOFError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"not the statistics of a run ({str(error):.200})") from None


MOMENTS = ("mean", "std", "min", "max", "time_min", "time_max")


def _without_nan(about):
    """Return the mapping with NaN of flags as None, which JSON has."""
    flags = [{k: None if v != v else v for k, v in flag.items()} for flag in about["flags"]]
    return about | {"flags": flags}


def _flat_at(at, names):
    """Return ((n, 3) numbers of load, side and channel, (n,) values) of simultaneous values."""
    entries = [
        (names[load], int(side == "max"), names[name], value)
        for load, sides in at.items()
        for side, found in sides.items()
        for name, value in found.items()
    ]
    rows = np.array([entry[:3] for entry in entries], dtype=np.int16).reshape(-1, 3)
    return rows, np.array([entry[3] for entry in entries], dtype=np.float64)


def _loaded(cls, data):
    """Return the RunStatistics of stored arrays."""
    about = parse_json(str(data["about"]))
    if about["format"] != FORMAT:
        raise InputError(f"statistics of format {about['format']!r}: this version reads format {FORMAT}")
    channels = tuple(about["channels"])
    at = {}
    for (load, side, name), value in zip(data["at_rows"], data["at_values"], strict=True):
        sides = at.setdefault(channels[load], {})
        sides.setdefault("max" if side else "min", {})[channels[name]] = float(value)
    cycles, begin = {}, 0
    for (name, count, width, mean_width, length), sums in zip(about["cycles"], data["sums"], strict=True):
        cycles[name] = Cycles(sums, count, width, mean_width, data["cells"][begin : begin + length])
        begin += length
    peaks, begin = {}, 0
    for name, side, length, count in about["peaks"]:
        peaks.setdefault(name, {})[side] = (data["peaks"][begin : begin + length].astype(np.float64), count)
        begin += length
    flags = tuple(
        Flag(**{k: nan if v is None and k in ("value", "time") else v for k, v in flag.items()})
        for flag in about["flags"]
    )
    moments = dict(zip(MOMENTS, data["moments"], strict=True))
    return cls(
        channels, **moments, duration=about["duration"], start=about["start"], at=at, cycles=cycles,
        peaks=peaks, flags=flags,
    )  # fmt: skip


# --------------------------------------------------------------------------- rainflow


@entry
def _count_cycles(points, found):
    """Fill found (n, 3) with range, mean and count of the cycles of n turning points; return their number."""
    n = points.shape[0]
    stack = np.empty(n)
    size = number = 0
    for k in range(n):
        stack[size] = points[k]
        size += 1
        while size >= 3:
            x1, x2, x3 = stack[size - 3], stack[size - 2], stack[size - 1]
            if abs(x3 - x2) < abs(x2 - x1):
                break
            found[number, 0], found[number, 1] = abs(x2 - x1), 0.5 * (x1 + x2)
            if size == 3:  # the first of all points leaves
                found[number, 2] = 0.5
                stack[0], stack[1] = x2, x3
                size = 2
            else:
                found[number, 2] = 1.0
                stack[size - 3] = x3
                size -= 2
            number += 1
    for k in range(size - 1):
        found[number, 0], found[number, 1] = abs(stack[k + 1] - stack[k]), 0.5 * (stack[k] + stack[k + 1])
        found[number, 2] = 0.5
        number += 1
    return number


def rainflow_cycles(values):
    """Return (n, 3) range, mean and count of the rainflow cycles of values (k,), finite floats.

    ASTM E1049-85, 5.4.4, in the order of the package `rainflow`: counts are 1, or 0.5 of the residue. First
    and last value are turning points.
    """
    steps = np.diff(values)
    moved = steps != 0.0
    after, steps = values[1:][moved], steps[moved]
    corners = after[:-1][steps[:-1] * steps[1:] < 0.0]
    points = np.concatenate([values[:1], corners, values[-1:]])
    found = np.empty((len(points), 3))
    return found[: _count_cycles(points, found)]


def _dyadic(extent):
    """Return the least power of two of which BINS cover an extent."""
    return 2.0 ** np.ceil(log2(extent / BINS)) if extent > 0.0 else 1.0


def cycles_of(values, matrix=True):
    """Return the Cycles of a channel, without cells if matrix is False."""
    ranges, means, counts = rainflow_cycles(values).T
    sums, power, reached = [], np.ones_like(ranges), 0
    for exponent in EXPONENTS:
        for _ in range(exponent - reached):
            power = power * ranges
        reached = exponent
        sums.append(float(counts @ power))
    if not matrix:
        return Cycles(np.array(sums), float(counts.sum()), 1.0, 1.0, np.empty((0, 3), np.int32))
    width, mean_width = _dyadic(ranges.max(initial=0.0)), _dyadic(np.ptp(means) if means.size else 0.0)
    # the largest range of exactly BINS widths belongs to the last bin
    i = np.minimum(np.floor(ranges / width), BINS - 1).astype(np.int64)
    j = np.floor(means / mean_width).astype(np.int64)
    lowest = int(j.min(initial=0))
    across = int(j.max(initial=0)) - lowest + 1
    halves = np.bincount(i * across + (j - lowest), weights=2.0 * counts)
    filled = np.nonzero(halves)[0]
    cells = np.stack([filled // across, filled % across + lowest, halves[filled]], axis=1).astype(np.int32)
    return Cycles(np.array(sums), float(counts.sum()), float(width), float(mean_width), cells)


# --------------------------------------------------------------------------- peaks


def independent_peaks(time, values):
    """Return (the MOST_PEAKS largest peaks (n,) in order of time, number of all peaks).

    A peak is the largest value between two upcrossings of PEAK_LEVEL standard deviations above the mean; of
    peaks closer than PEAK_SEPARATION the largest remains.
    """
    level = np.mean(values) + PEAK_LEVEL * np.std(values)
    above = values > level
    starts = np.flatnonzero(above[1:] & ~above[:-1]) + 1
    if above[0]:
        starts = np.concatenate([[0], starts])
    if not starts.size:
        return np.empty(0), 0
    tops = np.maximum.reduceat(values, starts)
    when = np.array([
        time[a + np.argmax(values[a:b])] for a, b in zip(starts, [*starts[1:], len(values)], strict=True)
    ])  # fmt: skip
    kept, taken = [], np.zeros(len(tops), dtype=bool)
    for index in np.argsort(-tops, kind="stable"):
        if not taken[index]:
            kept.append(index)
            taken |= np.abs(when - when[index]) < PEAK_SEPARATION
    largest = np.sort(kept[:MOST_PEAKS])
    return tops[largest], len(kept)


# --------------------------------------------------------------------------- one run


def run_statistics(frame, scene, skip, limits=None):
    """Return the RunStatistics of a run after `skip` seconds.

    frame    output of simulate: columns with OpenFAST names, evenly spaced rows
    scene    its Scene: rated rotor speed, deck height, number of lines
    limits   {constraint: limit or None} in place of LIMITS
    Raises: InputError for an unknown constraint, a skip that leaves fewer than two rows, or NaN in a channel.
    """
    limits = _checked_limits(limits)
    names, values = list(frame.columns), frame.to_numpy(dtype=np.float64)
    if names[0] != TIME:
        raise InputError(f"statistics: the first column must be {TIME}")
    begin = int(np.searchsorted(values[:, 0], values[0, 0] + skip - 1e-9))
    values = values[begin:]
    if len(values) < 2:
        raise InputError(
            f"statistics: skip = {skip:g} s leaves {len(values)} rows of a run: at least 2 are needed"
        )
    time = values[:, 0]
    found = {name.partition("_[")[0]: (name, values[:, k]) for k, name in enumerate(names)}
    for name, (_, x, y) in RESULTANTS.items():
        if x in found and y in found:
            unit = found[x][0].partition("_[")[2]
            found[name] = (f"{name}_[{unit}", np.hypot(found[x][1], found[y][1]))
    table = np.array([column for _, column in found.values()])  # (channels, time): contiguous in time
    if not np.isfinite(table).all():
        bad = next(
            name for (name, _), row in zip(found.values(), table, strict=True) if not np.isfinite(row).all()
        )
        raise InputError(f"statistics: channel {bad} has values that are not finite")
    place = {name: k for k, name in enumerate(found)}
    columns = [column for column, _ in found.values()]
    low, high = table.argmin(axis=1), table.argmax(axis=1)
    at = _simultaneous(place, columns, table, low, high)
    cycles = {
        columns[k]: cycles_of(table[k])
        for name, k in place.items()
        if name in FATIGUE_LOADS or name.startswith(LINES)
    }
    moments = [
        table.mean(axis=1),
        table.std(axis=1),
        table.min(axis=1),
        table.max(axis=1),
        time[low],
        time[high],
    ]
    peaks = {columns[k]: _both_peaks(time, table[k]) for name, k in place.items() if _extrapolated(name)}
    _add_directions(place, table, time, columns, moments, at, cycles)
    flags = _flags(place, table, time, scene, limits)
    return RunStatistics(
        tuple(columns), *map(np.asarray, moments), duration=float(time[-1] - time[0]), start=float(time[0]),
        at=at, cycles=cycles, peaks=peaks, flags=flags,
    )  # fmt: skip


def _checked_limits(limits):
    """Return LIMITS with those of the designer. Raises: InputError."""
    for name, value in (limits or {}).items():
        if name not in LIMITS:
            raise InputError(f"limits: unknown constraint {name!r}; known are {', '.join(LIMITS)}")
        if value is not None:
            check_number(
                f"limits[{name!r}]", value, -inf, low_open=True, allowed="a number, or None for no limit"
            )
    return LIMITS | (limits or {})


def _extrapolated(name):
    """Return whether the peaks of a channel without its unit are kept."""
    return name in EXTRAPOLATED or name.startswith("FAIRTEN")


def groups_of(names):
    """Return {group: channel names without units} of the loads among names, resultants included."""
    found = {}
    for group, members in GROUPS.items():
        for i in BLADES if "{}" in group else (0,):
            here = [m.format(i) for m in members if m.format(i) in names]
            own = group.format(i)
            here += [name for name, (where, _, _) in RESULTANTS.items() if where == own and name in names]
            if here:
                found[own] = here
    if lines := [name for name in names if name.startswith(LINES)]:
        found[MOORING] = lines
    return found


def _simultaneous(place, columns, table, low, high):
    """Return {column: {"min" or "max": {column: value}}} at the extremes of each load of a group.

    Kept are the loads of its group, itself included, and CONDITIONS.
    """
    at = {}
    for members in groups_of(place).values():
        kept = [place[name] for name in dict.fromkeys([*members, *CONDITIONS]) if name in place]
        for name in members:
            k = place[name]
            at[columns[k]] = {
                side: {columns[i]: float(table[i, row]) for i in kept}
                for side, row in (("min", low[k]), ("max", high[k]))
            }
    return at


def _both_peaks(time, values):
    """Return {"max": peaks, "min": peaks of the negative series, with their own sign}."""
    lower, count = independent_peaks(time, -values)
    return {"max": independent_peaks(time, values), "min": (-lower, count)}


def rose_of(names):
    """Return {interface: (channel at 0 deg, channel at 90 deg)} of ROSES among names without units."""
    found = {}
    for interface, pairs in ROSES.items():
        pair = next((pair for pair in pairs if set(pair) <= set(names)), None)
        if pair is not None:
            found[interface] = pair
    return found


def direction_column(pair, angle):
    """Return the column of the bending moment of two channels in a direction, deg from the first."""
    return f"{pair[0]}/{pair[1]}@{angle:g}_[kN-m]"


def _add_directions(place, table, time, columns, moments, at, cycles):
    """Append the moments of ROSES in DIRECTIONS to columns and statistics: M0 cos(angle) + M90 sin(angle)."""
    groups = {name: members for members in groups_of(place).values() for name in members}
    for pair in rose_of(place).values():
        x, y = (table[place[name]] for name in pair)
        for angle in DIRECTIONS:
            values = np.cos(np.radians(angle)) * x + np.sin(np.radians(angle)) * y
            column = direction_column(pair, angle)
            low, high = int(values.argmin()), int(values.argmax())
            kept = [place[name] for name in dict.fromkeys([*groups[pair[0]], *CONDITIONS]) if name in place]
            at[column] = {
                side: {columns[i]: float(table[i, row]) for i in kept}
                for side, row in (("min", low), ("max", high))
            }
            cycles[column] = cycles_of(values, matrix=False)
            own = (values.mean(), values.std(), values[low], values[high], time[low], time[high])
            for k, value in enumerate(own):
                moments[k] = np.append(moments[k], value)
            columns.append(column)


def _flags(place, table, time, scene, limits):
    """Return the Flags of the constraints that the channels of a run define."""
    flags = []

    def add(name, values, unit, worst=np.argmax):
        row = int(worst(values))
        flags.append(Flag(name, float(values[row]), unit, limits[name], float(time[row])))

    rated = ratings(scene.turbine)["rated_rotor_speed_[rpm]"]
    add("overspeed", table[place["RotSpeed"]] / rated, "of rated")
    add("platform pitch", table[place["PtfmTilt"]], "deg")
    add("nacelle acceleration", table[place["NcIMUTAxys"]], "m/s^2")
    # at the tower's axis, over the undisturbed waves
    deck = scene.model.layout.base_height * np.cos(np.radians(table[place["PtfmTilt"]]))
    add("air gap", deck + table[place["PtfmHeave"]] - table[place["Wave1Elev"]], "m", np.argmin)
    add("offset", table[place["PtfmOffset"]], "m")
    lines = [table[k] for name, k in place.items() if name.startswith("FAIRTEN")]
    if lines:
        add("line tension", np.max(lines, axis=0), "kN")
    holding = [tension for tension in lines if tension[-1] > 0.0]  # a line that broke is not slack
    if holding:
        slack = min(holding, key=lambda tension: tension.min() / tension.mean())
        add("slack line", slack / slack.mean(), "of mean", np.argmin)
    return tuple(flags)
