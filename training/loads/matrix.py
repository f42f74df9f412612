"""Expands the design load cases of cases.toml for a site, a platform and controllers into single runs.

Each condition (wind, sea, directions, fault) has one name, and its seeds are the same for every controller.
Hours per year are those of the site: production and idling by the probability of their winds, repair by the
availability, events by their number per year.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import product
from math import log2, pi
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from fowt_env.descriptions.checks import check_number, is_number, parse_names
from fowt_env.descriptions.faults import KINDS, PLATFORM_FAULTS, Fault
from fowt_env.descriptions.files import read_toml
from fowt_env.descriptions.platform import read_platform, turbine_of
from fowt_env.descriptions.records import NonNegative, Positive, Record, bounded, checked_record, validate
from fowt_env.errors import InputError, unknown
from fowt_env.scene.options import FIDELITIES
from fowt_env.training.evaluation.cases import TRIP, WIND_KINDS, Case, check_sensors
from fowt_env.training.evaluation.run_case import CONTROL_DT, PARKED
from fowt_env.training.loads.records import ANALYSES, CHARACTERISTICS, HOUR, SAFETY_CLASSES, LoadCase
from fowt_env.training.loads.site import HOUR_FACTOR, YEAR, Climate, climate_of, read_site

TABLE = Path(__file__).parent / "cases.toml"
SPEEDS = ("bins", "idle", "rated", "rated_out", "range", "extreme_50", "extreme_1")
SEAS = ("scatter", "normal", "severe", "extreme_50", "extreme_1")
TURBULENT = ("ntm", "etm", "ewm")
GUSTS = ("eog", "ecd", "edc", "ews")
TURNED = (*TURBULENT, "nwp")  # kinds of wind that can blow at an angle to the rotor
RATED_STEP = 2.0  # m/s about rated wind
IDLE_WIDTH = 5.0  # m/s, of the bin of winds above cut-out; the last bin is open
POINTS = 16  # of a box of wind in each direction across: 12.5 cells over the rotor
BOX_STEP = (0.05, 5.0)  # s, least and most between the slices of a box
MOST_SLICES = 13  # base-2 logarithm; 8192 of them take 0.7 GB while they are made
RAMP = 60.0  # s over which waves grow: a sea that begins at once can trip a turbine within a minute
SPARE = 2.0  # rotor diameters that a box is longer than the run
START, EACH = "start", "each"  # of a run; of the lines or compartments of a platform
EXAMPLE_OF_EACH = {  # keys that are filled in from the platform or the command, to check the others
    "line_loss": {"line": 1},
    "flooded_compartment": {"mass": 1.0, "point": (0.0, 0.0, 0.0)},
}
START_UP = "start_up"
OWN_START = 2400.0  # s of a start-up by the controller: ROSCO's takes 1700 s with the defaults of its toolbox
FULL_PROTECTION = tuple(kind for kind in KINDS if kind not in (*PLATFORM_FAULTS, START_UP))
Angles = tuple[bounded(ge=-180, le=180), ...]


class Factor(Record):
    """Defines a partial safety factor for loads."""

    value: Positive
    source: str


class CaseEntry(Record):
    """Defines a design load case: one [[case]] of cases.toml, which explains the keys."""

    dlc: str
    description: str
    source: str
    left_out: str = ""  # what cannot be run, and why; without a wind all of the case
    wind: Literal[(*TURBULENT, *GUSTS, "nwp")] | None = None
    variants: tuple[dict[str, Any], ...] = ({},)  # further keys of the wind
    speeds: Literal[SPEEDS] | None = None
    sea: Literal[SEAS] | None = None
    yaw_errors: Angles | Literal["site"] = (0.0,)
    misalignments: Angles | Literal["site", "extreme"] = (0.0,)
    parked: Annotated[bool, Field(strict=True)] = False
    individual: Annotated[bool, Field(strict=True)] = False  # blades pitch on their own
    length: Positive | Literal["hours"] = "hours"  # s
    at: tuple[NonNegative, ...] = ()  # s after the transient, starts of a gust
    faults: tuple[dict[str, Any], ...] = ()
    events: Literal["start", "stop", "fault"] | None = None
    analysis: Literal[ANALYSES] | None = None
    safety: Literal[SAFETY_CLASSES] | None = None
    factor: str | None = None  # name of a factor; None: that of the safety class
    characteristic: Literal[CHARACTERISTICS] = "largest"
    runs_of: str | None = None  # number of the design load case whose runs these are

    def _problems(self):
        if self.wind is None:
            if not self.left_out:
                yield f"wind is missing: {self.dlc} needs it, or left_out"
            return
        for key in ("speeds", "sea", "analysis", "safety"):
            if getattr(self, key) is None:
                yield f"{key} is missing: {self.dlc} needs it"
        if self.wind in GUSTS and not self.at:
            yield f"at is missing: the start of the {self.wind} in s after the transient"
        if self.wind in GUSTS and self.yaw_errors not in ((0.0,), "site"):
            yield f"yaw_errors: a {self.wind} blows along the rotor axis"
        for number, fault in enumerate(self.faults, 1):
            keys = {key: value for key, value in fault.items() if value != EACH} | EXAMPLE_OF_EACH.get(
                fault.get("kind"), {}
            )
            after = keys.pop("after", None)
            if after != START and not is_number(after):
                yield f"faults.{number}.after is missing: s after the transient, or {START!r}"
            for problem in validate(Fault, {**keys, "time": 0.0})[1]:
                yield f"faults.{number}.{problem}"


class CasesFile(Record):
    """Defines the content of cases.toml."""

    version: int
    source: str
    factor: dict[str, Factor]
    case: tuple[CaseEntry, ...]

    def _problems(self):
        numbers = [entry.dlc for entry in self.case]
        for dlc, count in Counter(numbers).items():
            if count > 1:
                yield f"case {dlc!r}: defined twice"
        for entry in self.case:
            name = entry.factor or entry.safety
            if entry.wind is not None and name not in self.factor:
                yield f"case {entry.dlc}: {unknown('factor', name, self.factor)}"
            if entry.runs_of is not None and entry.runs_of not in numbers:
                yield f"case {entry.dlc}: runs_of = {entry.runs_of!r}: is not a case of this file"


class Bin(NamedTuple):
    """Holds a class of mean winds: the wind that is run, its edges and its probability."""

    speed: float  # m/s
    edges: tuple[float, float] | None
    probability: float


@dataclass(frozen=True)
class Matrix:
    """Holds the runs of a load table with what is left out of it.

    cases: LoadCases; several may share one run, whose key they have. left_out: (number, description, reason).
    """

    cases: tuple[LoadCase, ...]
    left_out: tuple[tuple[str, str, str], ...]
    remarks: tuple[str, ...]
    source: str

    @property
    def runs(self):
        """Return {key: LoadCase} of the different runs, in order."""
        found = {}
        for case in self.cases:
            found.setdefault(case.key, case)
        return found

    @property
    def hours(self):
        """Return the simulated time of all runs, h, with their transients."""
        return sum(case.duration for case in self.runs.values()) / HOUR

    def counts(self):
        """Return [(dlc, description, conditions, runs, simulated h)] by design load case, without sharing."""
        rows = []
        for dlc in dict.fromkeys(case.dlc for case in self.cases):
            mine = [case for case in self.cases if case.dlc == dlc]
            hours = sum(case.duration for case in mine) / HOUR
            rows.append((dlc, mine[0].description, len({case.name for case in mine}), len(mine), hours))
        return rows


def read_cases(path=TABLE):
    """Return the CasesFile of a file of load cases. Raises: InputError with a line per wrong entry."""
    return checked_record(CasesFile, read_toml(path, "load case"), f"load case file {str(path)!r}")


def expanded(
    platform,
    site,
    controllers=("pi",),
    *,
    dlc=None,
    seeds=6,
    hours=1.0,
    wind="full-field",
    fidelity="standard",
    sensors="standard",
    compartments=(),
    table=TABLE,
    first_seed=1,
):
    """Return the Matrix of a load table.

    platform     name or path of a platform file
    site         name, path or SiteFile (site.read_site)
    controllers  labels
    dlc          numbers of design load cases, None: all
    seeds        realisations of wind and sea of each condition
    hours        length of a run that is not an event, to the next whole second
    wind         "full-field" or "rotor-averaged" turbulence
    fidelity     of build_scene; sensors: name of the chain
    compartments   of the platform that may be flooded: {"mass": kg, "point": [x, y, z] in m} each
    Raises: InputError naming the key, its value and what is allowed.
    """
    file, site = read_cases(table), read_site(site)
    entries = _chosen(file.case, dlc)
    if wind not in WIND_KINDS:
        raise unknown("wind", wind, WIND_KINDS)
    if fidelity not in FIDELITIES:
        raise unknown("fidelity", fidelity, FIDELITIES)
    sensors = check_sensors(sensors)
    check_number("hours", hours, 0.05, 24.0, allowed="a number in [0.05, 24]")
    if isinstance(seeds, bool) or not isinstance(seeds, int) or not 1 <= seeds <= 1000:
        raise InputError(f"seeds = {seeds!r}: must be a whole number in [1, 1000]")
    description = read_platform(platform)
    turbine = turbine_of(description)
    settings = _Settings(
        platform, climate_of(site, turbine), turbine, tuple(controllers),
        tuple(range(first_seed, first_seed + seeds)), hours, wind == "full-field", fidelity, sensors, file,
        description, tuple(compartments),
    )  # fmt: skip
    cases, left_out = [], []
    for entry in entries:
        if entry.wind is not None:
            cases += settings.cases(entry)
        if reason := entry.left_out or settings.lacking(entry):
            left_out.append((entry.dlc, entry.description, reason))
    depth = description.environment.water_depth
    remarks = []
    if site.water_depth is not None and abs(depth - site.water_depth) > 0.1 * depth:
        remarks.append(
            f"the site is {site.water_depth:g} m deep and the platform is moored in {depth:g} m, in which the"
            " waves are computed"
        )
    return Matrix(tuple(cases), tuple(left_out), tuple(remarks), file.source)


def _chosen(entries, dlc):
    """Return the CaseEntries of numbers (a list or "1.2,6.1"; None: all). Raises: InputError."""
    if dlc is None:
        return entries
    numbers = parse_names(dlc) if isinstance(dlc, str) else list(dlc)
    known = {entry.dlc: entry for entry in entries}
    for number in numbers:
        if number not in known:
            raise unknown("design load case", number, known)
    if not numbers:
        raise InputError("dlc: at least one design load case is needed")
    return [entry for entry in entries if entry.dlc in numbers]


@dataclass(frozen=True)
class _Settings:
    """Holds what all cases of a table share, and expands one entry of the table."""

    platform: Any
    climate: Climate
    turbine: Any
    controllers: tuple
    seeds: tuple
    hours: float
    full_field: bool
    fidelity: str
    sensors: str
    file: CasesFile
    description: Any  # of the platform
    compartments: tuple

    def cases(self, entry):
        """Return the LoadCases of a CaseEntry."""
        site = self.climate.site
        design = site.design
        factor = self.file.factor[entry.factor or entry.safety]
        skip = design.transient
        length = self._length(entry)
        yaws = design.yaw_errors if entry.yaw_errors == "site" else entry.yaw_errors
        faults = self._faults(entry)
        starts = entry.at or (None,)
        angles = self._misalignments(entry)
        bins = self._bins(entry)
        shared = len(yaws) * len(faults) * len(entry.variants) * len(starts) * len(self.seeds)
        found = []
        for each, variant, at, fault, yaw, (angle, likely) in product(
            bins, entry.variants, starts, faults, yaws, angles
        ):
            for sea in self._seas(entry, each.speed):
                Hs, Tp, share = sea
                year = self._hours_per_year(entry, length) * each.probability * share * likely / shared
                name = self._name(entry, each.speed, variant, at, fault, yaw, angle, Hs, Tp)
                for order, seed in enumerate(self.seeds):
                    case = self._case(
                        entry, name, each.speed, variant, at, fault, yaw, angle, (Hs, Tp), order
                    )
                    found += [
                        LoadCase(
                            entry.dlc, name, entry.description, case, label, seed, skip + length, skip,
                            entry.analysis, entry.safety, factor.value, factor.source, entry.source,
                            entry.characteristic, each.speed, each.edges, Hs, Tp, yaw,
                            _wrapped(yaw + angle), yaw, year,
                        )
                        for label in ((PARKED,) if entry.parked else self.controllers)
                    ]  # fmt: skip
        return found

    def _faults(self, entry):
        """Return the faults of an entry, one for each line or compartment; (None,) without a fault."""
        found = []
        for fault in entry.faults:
            if fault.get("line") == EACH:
                found += [fault | {"line": line + 1} for line in range(len(self.description.lines))]
            elif fault.get("compartment") == EACH:
                found += [
                    fault | {"compartment": number + 1} | each
                    for number, each in enumerate(self.compartments)
                ]
            elif fault["kind"] == START_UP:
                found.append(fault | {"by": self.climate.site.design.start})
            else:
                found.append(fault)
        return tuple(found) if entry.faults else (None,)

    def lacking(self, entry):
        """Return why an entry has no runs on this platform; "" if it has some."""
        if entry.wind is None or self._faults(entry):
            return ""
        if any("line" in fault for fault in entry.faults):
            return "The platform has no mooring lines."
        return "No compartment is given: --flood MASS:X:Y:Z, kg and m."

    def _length(self, entry):
        """Return the s of a run of an entry that are counted."""
        starts = any(fault["kind"] == START_UP for fault in entry.faults)
        if starts and self.climate.site.design.start == "controller":
            return OWN_START
        return float(round(self.hours * HOUR)) if entry.length == "hours" else entry.length

    def _bins(self, entry):
        """Return the Bins of an entry; probabilities of single winds are those of the winds about them."""
        climate, turbine = self.climate, self.turbine
        low, high, rated = turbine.cut_in_wind_speed, turbine.cut_out_wind_speed, turbine.rated_wind_speed
        if entry.speeds in ("extreme_50", "extreme_1"):
            wind = climate.extreme(50 if entry.speeds == "extreme_50" else 1)[0]
            return [Bin(round(wind * (HOUR_FACTOR if self.hours >= 1.0 else 1.0), 3), None, 0.0)]
        if entry.speeds == "bins":
            count = int(np.ceil((high - low) / climate.site.design.bin_width - 1e-9))
            edges = np.linspace(low, high, count + 1)
            return [self._bin(a, b, 0.5 * (a + b)) for a, b in zip(edges, edges[1:], strict=False)]
        if entry.speeds == "idle":
            bins = [self._bin(0.0, low), self._bin(high, high + IDLE_WIDTH)]
            return [*bins, self._bin(high + IDLE_WIDTH, np.inf)]
        speeds = {
            "rated": (rated - RATED_STEP, rated, rated + RATED_STEP),
            "rated_out": (rated - RATED_STEP, rated + RATED_STEP, high),
            "range": (low, rated, high),
        }[entry.speeds]
        edges = [low, *(0.5 * (a + b) for a, b in zip(speeds, speeds[1:], strict=False)), high]
        shares = np.diff(climate.below(np.array(edges)))
        shares /= shares.sum()
        return [Bin(round(float(v), 3), None, float(p)) for v, p in zip(speeds, shares, strict=True)]

    def _bin(self, low, high, speed=None):
        """Return the Bin between two winds; speed None: the mean wind in it."""
        below = [float(self.climate.below(low)), 1.0 if high == np.inf else float(self.climate.below(high))]
        probability = below[1] - below[0]
        if speed is None:
            quantiles = below[0] + probability * (np.arange(200) + 0.5) / 200
            speed = float(np.mean(self.climate.wind_at(quantiles)))
        return Bin(round(float(speed), 3), (float(low), float(high)), probability)

    def _seas(self, entry, speed):
        """Return [(Hs, Tp, probability)] of a wind."""
        if entry.sea == "scatter":
            seas = self.climate.seas(speed)
        elif entry.sea in ("extreme_50", "extreme_1"):
            seas = [(*self.climate.extreme(50 if entry.sea == "extreme_50" else 1)[1:3], 1.0)]
        else:
            expected = entry.sea == "normal"
            seas = [(*(self.climate.expected_sea if expected else self.climate.severe_sea)(speed), 1.0)]
        return [(round(float(Hs), 3), round(float(Tp), 3), share) for Hs, Tp, share in seas]

    def _misalignments(self, entry):
        """Return [(misalignment, probability)] of an entry."""
        site = self.climate.site
        if entry.misalignments == "site":
            return [(each.misalignment, each.probability) for each in site.direction]
        angles = entry.misalignments
        if angles == "extreme":
            angles = site.design.extreme_misalignments
        return [(angle, 1.0 / len(angles)) for angle in angles]

    def _hours_per_year(self, entry, length):
        """Return the hours per year of all runs of an entry; of extreme conditions none."""
        design = self.climate.site.design
        if entry.events is not None:
            return design.events.get(entry.events, 0.0) * length / HOUR
        if entry.speeds == "idle":
            return YEAR
        if entry.speeds != "bins" or entry.sea not in ("scatter", "normal") or entry.wind != "ntm":
            return 0.0
        return YEAR * ((1.0 - design.availability) if entry.parked else design.availability)

    def _name(self, entry, speed, variant, at, fault, yaw, angle, Hs, Tp):
        """Return the name of a condition: plain, so that it is the name of a file."""
        parts = [f"dlc{entry.runs_of or entry.dlc}", f"u{speed:g}"]
        for key, value in variant.items():
            parts.append(str(value) if isinstance(value, str) else f"{key}{value:+g}")
        if fault is not None:
            texts = [
                str(fault["kind"]),
                *(str(fault[key]) for key in ("towards", "field", "line", "compartment") if key in fault),
            ]
            parts.append("-".join(texts))
        if len(entry.at) > 1:
            parts.append(f"at{at:g}")
        parts += [f"h{Hs:g}", f"t{Tp:g}"]
        parts += [f"{word}{value:+g}" for word, value in (("yaw", yaw), ("mis", angle)) if value]
        return "_".join(parts).replace("+", "p").replace(" ", "_")

    def _case(self, entry, name, speed, variant, at, fault, yaw, angle, sea, order):
        """Return the Case of a condition; order: number of the seed, which shifts the azimuth of an event."""
        site = self.climate.site
        start = site.design.transient
        third = 2.0 * pi / 3.0 / self.turbine.rated_rotor_speed
        late = round(third * order / len(self.seeds) / CONTROL_DT) * CONTROL_DT
        Hs, Tp = sea
        heading = _wrapped(yaw + angle)
        options = {"fidelity": self.fidelity}
        if site.shear_exponent is not None:
            options["shear_exponent"] = site.shear_exponent
        if entry.individual:
            options["pitch"] = "individual"
        if current := self._current(entry, heading):
            options["current"] = current
        event = None
        if fault is not None:
            keys = {key: value for key, value in fault.items() if key not in ("after", "compartment")}
            time = 0.0 if fault["after"] == START else round(start + fault["after"] + late, 6)
            event = Fault(**keys, time=time)
        full = event is not None and event.kind in FULL_PROTECTION and not entry.parked
        return Case(
            name,
            self._wind(entry, speed, variant, yaw, None if at is None else start + at + late),
            {"kind": "jonswap", "Hs": Hs, "Tp": Tp, "heading": heading, "ramp": min(RAMP, 0.5 * start)},
            self.platform,
            options,
            # a rotor at rest starts to idle within the transient; far above cut-out the search for an idling
            # speed can fail
            initial={"start": "parked"} if entry.parked else None,
            fault=event,
            parked=entry.parked,
            # without a fault the overspeed trip alone: another would end the production that is studied
            trip=None if full else TRIP,
            protection="turbine" if full else None,
            sensors=self.sensors,
        )

    def _wind(self, entry, speed, variant, yaw, start):
        """Return the wind of build_scene for an entry at a mean speed."""
        about = self.climate.site.wind
        if entry.wind == "nwp":
            return {"kind": "steady", "speed": speed, "direction": yaw, **variant}
        if entry.wind in GUSTS:
            keys = {"kind": entry.wind, "speed": speed, "start": round(start, 6), **variant}
            keys |= {} if entry.wind == "ecd" else {"class": about.turbulence_class}
            return keys | ({"turbine_class": about.turbine_class} if entry.wind == "eog" else {})
        if self.full_field:
            diameter = 2.0 * self.turbine.rotor.tip_radius
            length = self._length(entry) + self.climate.site.design.transient + SPARE * diameter / speed
            # as many slices as make cells about as long as wide; a power of two, to which a box is rounded up
            cells = length * speed / (1.2 * diameter / (POINTS - 1))
            step = length / 2.0 ** min(round(log2(cells)), MOST_SLICES)
            return {
                "kind": "mann", "model": entry.wind, "speed": speed, "class": about.turbulence_class,
                "turbine_class": about.turbine_class, "direction": yaw, "points": POINTS,
                "dt": float(np.clip(np.ceil(step * 1000.0) / 1000.0, *BOX_STEP)), **variant,
            }  # fmt: skip
        keys = {"kind": entry.wind, "speed": speed, "direction": yaw, **variant}
        if entry.wind == "ewm":
            return keys | {"turbulent": True, "recurrence": 50 if entry.speeds == "extreme_50" else 1}
        keys["class"] = about.turbulence_class
        return keys | ({"turbine_class": about.turbine_class} if entry.wind == "etm" else {})

    def _current(self, entry, heading):
        """Return the current of an entry as an option of build_scene, along the waves; {} without one."""
        site = self.climate.site
        speed = 0.0 if site.current is None else site.current.speed
        if entry.sea in ("extreme_50", "extreme_1"):
            speed = self.climate.extreme(50 if entry.sea == "extreme_50" else 1)[3]
        if speed == 0.0:
            return {}
        exponent = {} if site.current is None else {"exponent": site.current.exponent}
        return {"speed": speed, "heading": heading, **exponent}


def _wrapped(angle):
    """Return an angle (deg) in (-180, 180]."""
    return 180.0 - (180.0 - angle) % 360.0
