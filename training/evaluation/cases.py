"""Defines load cases, and reads suites of load cases from TOML files (built-in or of the user).

A `[[case]]` may define several cases: `speed = [12, 14]` and `name = "ntm_{speed}"` define one case per mean
wind speed, which is set as the speed of the wind and selects the row of the sea's table.
"""

import json
from collections import Counter
from dataclasses import dataclass, field, fields, replace
from math import exp
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from fowt_env.caches import cached
from fowt_env.descriptions.checks import is_number, parse_names, plain_number, short
from fowt_env.descriptions.faults import Fault
from fowt_env.descriptions.files import locate, raise_problems, read_toml
from fowt_env.descriptions.platform import platform_names, read_platform
from fowt_env.descriptions.protection import Protection, read_protection
from fowt_env.descriptions.records import NonNegative, Positive, Record, checked_record
from fowt_env.descriptions.sea_state import SeaState, joint_sea_state, sea_state_of
from fowt_env.descriptions.sensors import EXACT, sensor_chain
from fowt_env.descriptions.wind import FORMS, checked_keys, is_wind_file, read_wind, wind_of
from fowt_env.errors import InputError, unknown
from fowt_env.scene.options import OPTIONS
from fowt_env.training.evaluation.carried import missing_part
from fowt_env.training.evaluation.metrics import METRICS, better
from fowt_env.training.evaluation.plant_perturbation import PlantPerturbation
from fowt_env.training.evaluation.scaling import scaled_file, within_table
from fowt_env.weather.wind_field import is_field

FOLDER = Path(__file__).parent / "suites"
WIND_KINDS = ("rotor-averaged", "full-field")
TRIP = 1.3  # fraction of rated rotor speed of the default overspeed trip
DESCRIBED = (
    "name", "wind", "sea", "platform", "options", "fault", "parked", "initial", "shift", "trip", "sensors",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """Defines a load case: the arguments of build_scene except the seed, and the events of the run.

    parked: the turbine idles with feathered blades (at rest without wind), so no controller is compared.
    initial: absolute values of channels at the start, as in simulate.
    seeds, duration, skip: values of this case if they differ from the suite's. shift: perturbation of the
    nominal plant for which controllers are prepared (training.evaluation.plant_perturbation).
    """

    name: str
    wind: object = None  # as in build_scene
    sea: object = None
    platform: str = "oc3_hywind"
    # further options of build_scene; "standard" is within 1e-3 of "reference" at a fraction of the time
    options: dict = field(default_factory=lambda: {"fidelity": "standard"})
    fault: Fault | None = None
    parked: bool = False
    initial: dict | None = None
    seeds: tuple | None = None
    duration: float | None = None  # s
    skip: float | None = None  # s
    shift: PlantPerturbation | None = None  # unknown to the controllers
    trip: float | None = TRIP  # fraction of rated rotor speed; None: limit of the protection, if any
    sensors: str = EXACT  # name of the sensor chain between plant and controllers
    displaced: dict | None = None  # {channel: offset from the trim at the start}
    protection: object = None  # as in simulate: None, "turbine" or a mapping of trips
    source: str = ""  # source of the case, if it differs from the suite's


def mean_speed(case):
    """Return the mean wind speed (m/s) of a Case; None without wind, or for a time series or file."""
    if is_number(case.wind):
        return float(case.wind)
    speed = case.wind.get("speed") if isinstance(case.wind, dict) else None
    return float(speed) if is_number(speed) else None


def described(case):
    """Return a Case as a mapping of plain values for JSON; arrays as lists, other objects as text."""
    values = {key: getattr(case, key) for key in DESCRIBED}
    if isinstance(case.sea, SeaState):
        values["sea"] = case.sea.model_dump(exclude_none=True)
    if case.fault is not None:
        values["fault"] = case.fault.model_dump(exclude_none=True)
    if case.shift is not None:
        values["shift"] = case.shift.model_dump(exclude_defaults=True)
    further = {key: getattr(case, key) for key in ("displaced", "protection", "source")}
    values |= {key: value for key, value in further.items() if value not in (None, "")}
    return json.loads(json.dumps(values, default=_plain))


def _plain(value):
    """Return a JSON-compatible representation of a value."""
    number = plain_number(value)
    if isinstance(number, int | float):
        return number
    return value.tolist() if hasattr(value, "tolist") else repr(value)


def _names(names):
    """Return the list of names in a comma-separated text or a sequence."""
    return parse_names(names) if isinstance(names, str) else list(names)


def _many(value):
    """Return one value or several as a list."""
    return list(value) if isinstance(value, list | tuple) else [value]


Seeds = Annotated[tuple[Annotated[int, Field(ge=0, strict=True)], ...], BeforeValidator(_many)]


def _unless_false(value):
    return None if value is False else value  # TOML has no null


# fraction of rated rotor speed; false: no trip
Trip = Annotated[Annotated[float, Field(gt=1.0, le=3.0, strict=True)] | None, BeforeValidator(_unless_false)]


def _checked_protection(value):
    """Return the protection of a case after checking it; None for false."""
    if _unless_false(value) is not None:
        read_protection(value, Protection())
    return _unless_false(value)


Protected = Annotated[Any, BeforeValidator(_checked_protection)]


class CaseEntry(Record):
    """Defines a [[case]] of a suite file, before its expansion to one Case per wind speed."""

    name: str
    speed: Annotated[tuple[Positive, ...], BeforeValidator(_many)] | None = None  # m/s at hub height
    wind: Any = None
    sea: Any = None
    platform: str | None = None
    options: dict[str, Any] = {}
    fault: Fault | None = None
    parked: bool = False
    initial: dict[str, float] | None = None
    seeds: Seeds | None = None
    duration: Positive | None = None
    skip: NonNegative | None = None
    shift: PlantPerturbation | None = None
    trip: Trip = None  # default: the suite's
    protection: Protected = None  # default: the suite's
    source: str = ""
    sensors: str | None = None
    displaced: dict[str, float] | None = None  # offsets from the trim; replaces initial on another platform


class Site(Record):
    """Defines the wind climate of a site: Weibull distribution of ten-minute means at hub height."""

    A: Positive  # m/s, scale
    k: Positive  # shape
    source: str

    def below(self, speed):
        """Return the probability of a mean wind below a speed, m/s."""
        return 1.0 - exp(-((max(speed, 0.0) / self.A) ** self.k))


class ScoreTerm(Record):
    """Defines a term of a score: a metric, relative to the baseline's value, and its weight."""

    metric: str
    weight: Positive


class Score(Record):
    """Defines a score per controller: the weighted mean of metric/baseline, divided by relative power.

    Less is better. baseline: the controller whose runs without protection are the reference. by: what ranks:
    the score of lifetime means, the mean of the scores of single cases (winds), or the worse of the two.
    """

    baseline: str
    term: tuple[ScoreTerm, ...]
    power: str | None = None  # metric of which more is better; its ratio to the baseline's divides the mean
    by: Literal["lifetime", "winds", "worse"] = "lifetime"


Bound = Annotated[tuple[Positive, ...], BeforeValidator(_many)]  # one number or (least, most)


class SetPoint(Record):
    """Defines a set-point: the mean of a metric in each case is at most `within` of rated further from rated
    than the reference's, which leaves rated itself in winds with lulls.
    """

    rated: Positive
    within: Positive


class Limits(Record):
    """Defines limits of metrics; controllers that exceed a limit rank below the others (limits.py).

    run: {metric: maximum in any run}. lifetime: {metric: maximum of the lifetime mean}. relative: {metric:
    maximum ratio of the lifetime mean to that of the reference on the same runs}. case: {metric: maximum of
    the mean in each case}. case_relative: {metric: ratio of this mean to the reference's}, one number in the
    metric's better direction or [least, most]. set_point: {metric: SetPoint}. baseline: the controller whose
    runs without protection are the reference, as for the score.
    """

    run: dict[str, NonNegative] = {}
    lifetime: dict[str, NonNegative] = {}
    relative: dict[str, Positive] = {}
    case: dict[str, NonNegative] = {}
    case_relative: dict[str, Bound] = {}
    set_point: dict[str, SetPoint] = {}
    baseline: str = "gspi_oc3"

    @property
    def relative_metrics(self):
        """Return the metrics with limits relative to the reference."""
        return list(dict.fromkeys([*self.relative, *self.case_relative, *self.set_point]))

    @property
    def metrics(self):
        """Return the metrics with limits."""
        return list(dict.fromkeys([*self.run, *self.lifetime, *self.case, *self.relative_metrics]))

    def _problems(self):
        for name, bound in self.case_relative.items():
            two = len(bound) == 2 and bound[0] <= bound[1]
            if name in METRICS and not (two or (len(bound) == 1 and better(name))):
                one = "a number or " if better(name) else ""
                shown = bound[0] if len(bound) == 1 else list(bound)
                yield f"case_relative.{name} = {shown}: must be {one}[least, most]"


class SuiteFile(Record):
    """Defines the content of a suite file."""

    version: Annotated[int, Field(ge=1, strict=True)]
    description: str
    source: str
    wind: Literal[WIND_KINDS]
    seeds: Seeds = (1,)
    duration: Positive
    skip: NonNegative = 0.0
    platform: str = "oc3_hywind"
    turbine: str | None = None  # for which winds and limits are set; they are scaled to other turbines
    options: dict[str, Any] = {"fidelity": "standard"}
    left_out: str = ""
    case: tuple[CaseEntry, ...]
    score: Score | None = None
    trip: Trip = TRIP
    protection: Protected = None
    sensors: str = EXACT
    site: Site | None = None
    limits: Limits = Limits()
    rigid_loads: bool = False  # whether scores and limits may use fatigue loads of rigid parts (carried.py)


@dataclass(frozen=True)
class Suite:
    """Holds cases with the settings of their runs and of the comparison."""

    name: str
    version: int
    description: str
    source: str
    wind: str  # of WIND_KINDS
    seeds: tuple
    duration: float  # s
    skip: float  # s at the start of a run that are not scored
    cases: tuple
    left_out: str = ""
    score: Score | None = None
    site: Site | None = None
    limits: Limits = Limits()
    weights: dict = field(default_factory=dict)  # {case: fraction of the lifetime}; {}: equal weights
    drawn: dict | None = None  # hash and rule of drawn seeds (seeds.py); None: listed seeds

    @property
    def reference(self):
        """Return the name of the controller of the reference runs for score and relative limits, or None."""
        if self.score is not None:
            return self.score.baseline
        return self.limits.baseline if self.limits.relative_metrics else None


def lifetime_weights(cases, site):
    """Return {name: fraction of the lifetime} of Cases by their mean wind speeds; {} without a Site.

    The winds of the cases are bin centres with edges half-way between; the outer bins are symmetric. A bin's
    weight is its probability divided by that of all bins, divided equally among cases with the same wind. A
    parked turbine and a case without a mean wind speed have weight 0.
    Raises: InputError for fewer than two winds.
    """
    if site is None:
        return {}
    winds = {case.name: None if case.parked else mean_speed(case) for case in cases}
    count = Counter(speed for speed in winds.values() if speed is not None)
    speeds = sorted(count)
    if len(speeds) < 2:
        raise InputError(f"site: needs cases of two or more mean wind speeds, not {len(speeds)}")
    edges = [0.5 * (low + high) for low, high in zip(speeds, speeds[1:], strict=False)]
    edges = [2.0 * speeds[0] - edges[0], *edges, 2.0 * speeds[-1] - edges[-1]]
    weight = {speed: site.below(high) - site.below(low)
             for speed, low, high in zip(speeds, edges, edges[1:], strict=False)}  # fmt: skip
    total = sum(weight.values())
    return {
        name: 0.0 if speed is None else weight[speed] / count[speed] / total for name, speed in winds.items()
    }


def suite_names():
    """Return the names of the built-in suites, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def read_suite(name_or_path, platform=None):
    """Return the Suite of a built-in name or of a user's TOML file; a Suite unchanged.

    platform: name or path that replaces the platform of the file, with cases scaled to its turbine
    (training/evaluation/scaling.py); None: the platform of the file.
    Raises: InputError for an unknown name (with a suggestion), and with one line per wrong entry.
    """
    if isinstance(name_or_path, Suite):
        return name_or_path
    platform = None if platform is None else str(platform)
    if isinstance(name_or_path, str) and name_or_path in suite_names():
        known = platform is None or platform in platform_names()
        return (_kept if known else _read)(FOLDER / f"{name_or_path}.toml", platform)
    path = Path(locate("suite", name_or_path, suite_names(), listed="fowt list suites"))
    return _read(path, platform)


def _read(path, platform=None):
    """Return the Suite of a file, scaled to a platform unless None."""
    where = f"suite file {str(path)!r}"
    file = checked_record(SuiteFile, read_toml(path, "suite"), where)
    try:
        file = scaled_file(file, platform)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    cases, problems, weights = [], [], {}
    for number, entry in enumerate(file.case, 1):
        try:
            cases += _expanded(entry, file, path.parent)
        except InputError as error:
            problems.append(f"case.{number} ({entry.name}): {error}")
    count = Counter(case.name for case in cases)
    problems += [f"case {name!r}: defined twice" for name in sorted(count) if count[name] > 1]
    if not file.case:
        problems.append("case is missing: at least one [[case]] is needed")
    score, limits = file.score, file.limits
    terms = [] if score is None else [*(term.metric for term in score.term), *filter(None, [score.power])]
    for key, names in (("limits", limits.metrics), ("score", terms)):
        wrong = [name for name in names if name not in METRICS]
        problems += [f"{key}: {unknown('metric', name, METRICS)}" for name in wrong]
        problems += [] if file.rigid_loads else _rigid_loads(key, names, cases)
    if score is not None and limits.relative_metrics and limits.baseline != score.baseline:
        names = limits.baseline, score.baseline
        problems.append("limits.baseline = {!r}: must be the baseline of the score, {!r}".format(*names))
    for case in cases:
        duration, skip = case.duration or file.duration, file.skip if case.skip is None else case.skip
        below = f"must be below duration = {duration:g} s"
        if not duration > skip:
            problems.append(f"case {case.name!r}: skip = {skip:g} s: {below}")
        if case.fault is not None and not case.fault.time < duration:
            problems.append(f"case {case.name!r}: fault.time = {case.fault.time:g} s: {below}")
        if is_field(case.wind) != (file.wind == "full-field") and case.wind is not None:
            problems.append(
                f"case {case.name!r}: wind = {file.wind!r} of the suite does not match the kind of its wind"
            )
    try:
        weights = lifetime_weights(cases, file.site)
    except InputError as error:
        problems.append(str(error))
    raise_problems(where, problems)
    shared = {field.name for field in fields(Suite)} & set(SuiteFile.model_fields)
    settings = {key: getattr(file, key) for key in shared}
    return Suite(path.stem, cases=tuple(cases), weights=weights, **settings)


def _rigid_loads(key, names, cases):
    """Return a line per metric that is the fatigue load of a part that is rigid in a case."""
    lines = []
    for name in names:
        lacking = ((case.name, missing_part(name, case)) for case in cases)
        case, part = next((pair for pair in lacking if pair[1] is not None), ("", None))
        if part is not None:
            option, value, needed = part
            allowed = " or ".join(map(repr, needed))
            lines.append(
                f"{key}: {name}: case {case!r} has {option} = {value!r}, which lacks this load: needs"
                f" {option} = {allowed} (or rigid_loads = true, to count what a rigid part would have)"
            )
    return lines


_kept = cached(64)(_read)  # of built-in suites and platforms


def _expanded(entry, file, folder):
    """Return the Cases of a CaseEntry: one, or one per speed. Raises: InputError for wrong settings."""
    if entry.speed is not None and "{speed}" not in entry.name and len(entry.speed) > 1:
        raise InputError("name: must contain {speed}, since the case has several speeds")
    if entry.parked and entry.fault is not None:
        raise InputError("parked: a case with a parked turbine has no controller, so it cannot have a fault")
    options = {**file.options, **entry.options}
    for key in options:
        if key not in (*OPTIONS, "fidelity", "rotor"):
            raise unknown("option", key, (*OPTIONS, "fidelity", "rotor"))
    if entry.shift is not None and options.get("turbine") is not None:
        raise InputError("shift: needs the turbine of the platform; remove the option turbine")
    platform = entry.platform or file.platform
    if entry.platform is not None or platform != "oc3_hywind":
        read_platform(platform)
    same = ("fault", "parked", "initial", "seeds", "duration", "skip", "shift", "source")
    settings = {key: getattr(entry, key) for key in same}
    for key in ("trip", "protection"):
        settings[key] = getattr(entry if key in entry.model_fields_set else file, key)
    settings["sensors"] = check_sensors(file.sensors if entry.sensors is None else entry.sensors)
    settings["displaced"] = entry.displaced if entry.initial is None else None
    return [
        Case(
            entry.name.replace("{speed}", "" if speed is None else f"{speed:g}".replace(".", "_")),
            _wind(entry.wind, speed, folder),
            _sea(entry.sea, speed, file),
            platform,
            options,
            **settings,
        )
        for speed in (entry.speed or (None,))
    ]


def check_sensors(name):
    """Return the name of a built-in sensor chain or "exact". Raises: InputError for another name."""
    sensor_chain(name)
    return name


def _wind(spec, speed, folder):
    """Return the checked wind of a case. Raises: InputError for a wrong wind."""
    if spec is None:
        if speed is not None:
            raise InputError("wind is missing: speed sets the speed of a wind")
        return None
    if isinstance(spec, str):
        spec = wind_of(str(folder / Path(spec).expanduser()) if is_wind_file(spec) else spec)
    if is_number(spec):
        return float(spec)
    if not isinstance(spec, dict):
        raise InputError(f"wind = {short(spec)}: must be {FORMS}")
    spec = dict(spec)
    if speed is not None:
        if "speed" in spec:
            raise InputError("speed: set twice, for the case and in its wind")
        spec["speed"] = float(speed)
    if not is_field(spec):
        read_wind(spec)
        return spec
    checked_keys(spec)
    if "path" in spec:
        spec["path"] = str(folder / Path(spec["path"]).expanduser())
    return spec


def _sea(spec, speed, file):
    """Return the checked sea of a case; a scaled wind is limited to its table. Raises: InputError."""
    if isinstance(spec, dict) and "table" in spec:
        at = spec.get("speed", speed)
        extra = set(spec) - {"table", "speed"}
        if extra:
            raise unknown("key of a sea from a table", sorted(extra)[0], ("table", "speed"))
        if at is None:
            raise InputError("sea.speed is missing: the wind speed (m/s) of the table's row")
        if file.turbine is not None and file.platform != "oc3_hywind" and "speed" not in spec:
            at = within_table(spec["table"], at)
        return joint_sea_state(spec["table"], at)
    sea_state_of(spec)
    return spec


def all_cases(platform=None):
    """Return {name: Case} of the built-in suites; cases of the same name are identical."""
    cases = {}
    for suite in suite_names():
        for case in read_suite(suite, platform).cases:
            cases.setdefault(case.name, replace(case, seeds=None, duration=None, skip=None))
    return cases


def chosen_cases(suite, cases, platform=None):
    """Return the Suite or list of Cases for the names of a suite and of cases, either of which may be None.

    platform: name or path of the platform to which the cases are scaled; None: that of the suite.
    Raises: InputError for an unknown name, and for a case that is not in the suite.
    """
    if suite is None:
        return named_cases("above_rated" if cases is None else cases, platform)
    whole = read_suite(suite, platform)
    if cases is None:
        return whole
    known = {case.name: case for case in whole.cases}
    names = _names(cases)
    for name in names:
        if name not in known:
            raise unknown(f"case of suite {whole.name!r}", name, known)
    return replace(whole, cases=tuple(known[name] for name in dict.fromkeys(names)))


def named_cases(names, platform=None):
    """Return the Cases of names of cases and suites, in this order and without duplicates.

    names: a name, several separated by commas, or a sequence of names; a suite may be a path. platform: as
    in read_suite.
    Raises: InputError for an unknown name.
    """
    selected = {}
    known = all_cases(platform)
    for name in _names(names):
        if name in known:
            matches = [known[name]]
        elif name in suite_names() or str(name).endswith(".toml"):
            matches = read_suite(name, platform).cases
        else:
            raise unknown("case", name, (*suite_names(), *known), "fowt list cases, fowt list suites")
        for case in matches:
            selected.setdefault(case.name, case)
    if not selected:
        raise InputError("cases: at least one name is needed")
    return list(selected.values())
