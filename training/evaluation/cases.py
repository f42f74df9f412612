"""Load cases and suites of them, read from files: what controllers are compared on.

A suite is a TOML file of the folder suites, or the user's own. One `[[case]]` may stand for several: with
`speed = [12, 14]` and `name = "ntm_{speed}"` it is one case per mean wind speed, which then also stands
in its wind and picks the row of its sea's table.
"""

import functools
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from fowt_env.descriptions.checks import is_number, plain_number
from fowt_env.descriptions.files import locate, raise_problems, read_toml
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.records import (
    NonNegative,
    Positive,
    Record,
    validate,
)
from fowt_env.descriptions.sea_state import SeaState, joint_sea_state, sea_state_of
from fowt_env.descriptions.wind import read_wind
from fowt_env.errors import InputError, unknown
from fowt_env.scene.options import OPTIONS
from fowt_env.training.evaluation.faults import Fault
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.evaluation.plant_perturbation import PlantPerturbation
from fowt_env.weather.wind_field import FIELD_KINDS, REQUIRED, is_field

FOLDER = Path(__file__).parent / "suites"
WIND_KINDS = ("rotor-averaged", "full-field")


@dataclass(frozen=True)
class Case:
    """One load case: what build_scene is given, apart from the seed, and what happens in it.

    parked: the turbine idles with feathered blades (at rest without wind), so no controller is compared.
    initial: absolute values of channels at the start, as simulate takes them.
    seeds, duration, skip: of this case where they differ from the suite's. shift: how the plant differs from
    the nominal one, which controllers are prepared for (training.evaluation.model_mismatch).
    """

    name: str
    wind: object = None  # as build_scene takes it
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
    shift: PlantPerturbation | None = None  # what of the plant its controllers do not know


def described(case):
    """A Case as a mapping of plain values that JSON can hold; arrays and objects by their text."""
    sea = case.sea.model_dump(exclude_none=True) if isinstance(case.sea, SeaState) else case.sea
    values = {
        "name": case.name,
        "wind": case.wind,
        "sea": sea,
        "platform": case.platform,
        "options": case.options,
        "fault": None if case.fault is None else case.fault.model_dump(exclude_none=True),
        "parked": case.parked,
        "initial": case.initial,
        "shift": None if case.shift is None else case.shift.model_dump(exclude_defaults=True),
    }
    return _plain(values)


def _plain(value):
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if value is None or isinstance(value, bool | str):
        return value
    value = plain_number(value)
    if isinstance(value, int | float):
        return value
    return _plain(value.tolist()) if hasattr(value, "tolist") else repr(value)


def _many(value):
    """A list of what is given, one thing or several."""
    return list(value) if isinstance(value, list | tuple) else [value]


Seeds = Annotated[tuple[Annotated[int, Field(ge=0, strict=True)], ...], BeforeValidator(_many)]


class CaseEntry(Record):
    """One [[case]] of a suite file, before it is spread over its wind speeds."""

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


class ScoreTerm(Record):
    """One term of a score: the metric's weight in the sum, relative to the baseline's."""

    metric: str
    weight: Positive


class Score(Record):
    """One number per controller: the weighted mean of metric/baseline, over relative power; less is better.

    limits: metrics that must not exceed a value in any run; a controller beyond one has a score, but no
    valid one.
    """

    baseline: str
    term: tuple[ScoreTerm, ...]
    power: str | None = None  # metric of which more is better: the sum is divided by it over the baseline's
    limits: dict[str, NonNegative] = {}


class SuiteFile(Record):
    """The text of a suite file."""

    version: Annotated[int, Field(ge=1, strict=True)]
    description: str
    source: str
    wind: Literal[WIND_KINDS]
    seeds: Seeds = (1,)
    duration: Positive
    skip: NonNegative = 0.0
    platform: str = "oc3_hywind"
    options: dict[str, Any] = {"fidelity": "standard"}
    left_out: str = ""
    case: tuple[CaseEntry, ...]
    score: Score | None = None


@dataclass(frozen=True)
class Suite:
    """Cases with the settings under which they are run and compared."""

    name: str
    version: int
    description: str
    source: str
    wind: str  # of WIND_KINDS
    seeds: tuple
    duration: float  # s
    skip: float  # s at the start that are not scored
    cases: tuple
    left_out: str = ""
    score: Score | None = None


def suite_names():
    """Names of the built-in suites, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def read_suite(name_or_path):
    """Suite of a built-in name or of a user's TOML file.

    Raises: InputError for an unknown name (with a suggestion), and with one line per wrong entry.
    """
    if isinstance(name_or_path, Suite):
        return name_or_path
    if isinstance(name_or_path, str) and name_or_path in suite_names():
        return _built_in(name_or_path)
    path = Path(locate("suite", name_or_path, suite_names()))
    return _read(path)


@functools.cache
def _built_in(name):
    return _read(FOLDER / f"{name}.toml")


def _read(path):
    """Suite of a file."""
    where = f"suite file {str(path)!r}"
    file, problems = validate(SuiteFile, read_toml(path, "suite"))
    raise_problems(where, problems)
    cases = []
    for number, entry in enumerate(file.case, 1):
        try:
            cases += _spread(entry, file, path.parent)
        except InputError as error:
            problems.append(f"case.{number} ({entry.name}): {error}")
    names = [case.name for case in cases]
    problems += [f"case {name!r}: named twice" for name in sorted(set(names)) if names.count(name) > 1]
    if not file.case:
        problems.append("case is missing: at least one [[case]] is needed")
    problems += _score_problems(file.score)
    for case in cases:
        duration, skip = case.duration or file.duration, file.skip if case.skip is None else case.skip
        if not duration > skip:
            problems.append(f"case {case.name!r}: skip = {skip:g} s: must be below duration = {duration:g} s")
        if case.fault is not None and not case.fault.time < duration:
            problems.append(
                f"case {case.name!r}: fault.time = {case.fault.time:g} s:"
                f" must be below duration = {duration:g} s"
            )
        if is_field(case.wind) != (file.wind == "full-field") and case.wind is not None:
            problems.append(
                f"case {case.name!r}: wind = {file.wind!r} of the suite does not fit its kind of wind"
            )
    raise_problems(where, problems)
    fields = {key: getattr(file, key) for key in ("version", "description", "source", "wind", "left_out")}
    rest = {key: getattr(file, key) for key in ("seeds", "duration", "skip", "score")}
    return Suite(path.stem, cases=tuple(cases), **fields, **rest)


def _score_problems(score):
    """One line per metric of a Score that there is not."""
    named = [] if score is None else [term.metric for term in score.term] + list(score.limits)
    if score is not None and score.power is not None:
        named.append(score.power)
    return [f"score: {unknown('metric', name, METRICS)}" for name in named if name not in METRICS]


def _spread(entry, file, folder):
    """Cases of a CaseEntry: one, or one per speed. Raises: InputError."""
    if entry.speed is None:
        return [_case(entry, None, file, folder)]
    if "{speed}" not in entry.name and len(entry.speed) > 1:
        raise InputError("name: needs {speed} in it, for its several speeds")
    return [_case(entry, speed, file, folder) for speed in entry.speed]


def _case(entry, speed, file, folder):
    """Case of a CaseEntry at a mean wind speed (None: it has none to fill in)."""
    label = "" if speed is None else f"{speed:g}".replace(".", "_")
    if entry.parked and entry.fault is not None:
        raise InputError("parked: a parked turbine has no controller that a fault could act on")
    options = {**file.options, **entry.options}
    for key in options:
        if key not in (*OPTIONS, "fidelity", "rotor"):
            raise unknown("option", key, (*OPTIONS, "fidelity", "rotor"))
    if entry.shift is not None and options.get("turbine") is not None:
        raise InputError("shift: a case with one takes the turbine of its platform, not that of an option")
    if entry.platform is not None or file.platform != "oc3_hywind":
        read_platform(entry.platform or file.platform)
    return Case(
        entry.name.replace("{speed}", label),
        _wind(entry.wind, speed, folder),
        _sea(entry.sea, speed),
        entry.platform or file.platform,
        options,
        entry.fault,
        entry.parked,
        entry.initial,
        entry.seeds,
        entry.duration,
        entry.skip,
        entry.shift,
    )


def _wind(spec, speed, folder):
    """The wind of a case, checked. Raises: InputError."""
    if spec is None:
        if speed is not None:
            raise InputError("wind is missing: speed has nothing to fill")
        return None
    if is_number(spec):
        return float(spec)
    if not isinstance(spec, dict):
        raise InputError(f"wind = {spec!r}: must be a speed (m/s) or a table with a kind")
    spec = dict(spec)
    if speed is not None:
        if "speed" in spec:
            raise InputError("speed: given twice, for the case and in its wind")
        spec["speed"] = float(speed)
    if not is_field(spec):
        read_wind(spec)
        return spec
    keys = FIELD_KINDS[spec["kind"]]
    for key in spec:
        if key != "kind" and key not in keys:
            raise unknown(f"key of the {spec['kind']} wind", key, keys)
    for key, (rule, default) in keys.items():
        if default is REQUIRED and key not in spec:
            raise InputError(f"wind.{key} is missing: the {spec['kind']} wind needs it")
        if key in spec:
            rule.read(f"wind.{key}", spec[key])
    if "path" in spec:
        spec["path"] = str(folder / Path(spec["path"]).expanduser())
    return spec


def _sea(spec, speed):
    """The sea of a case, checked. Raises: InputError."""
    if isinstance(spec, dict) and "table" in spec:
        at = spec.get("speed", speed)
        extra = set(spec) - {"table", "speed"}
        if extra:
            raise unknown("key of a sea from a table", sorted(extra)[0], ("table", "speed"))
        if at is None:
            raise InputError("sea.speed is missing: the wind speed (m/s) of the table's row")
        return joint_sea_state(spec["table"], at)
    sea_state_of(spec)
    return spec


def all_cases():
    """{name: Case} of the built-in suites; a name that several hold means the same in each."""
    cases = {}
    for suite in suite_names():
        for case in read_suite(suite).cases:
            cases.setdefault(case.name, replace(case, seeds=None, duration=None, skip=None))
    return cases


def named_cases(names):
    """List of Cases for names of cases and suites, each once, in the order asked for.

    names: a name, several separated by commas, or a sequence of names; a suite may be a path.
    Raises: InputError for an unknown name.
    """
    if isinstance(names, str):
        names = [name.strip() for name in names.split(",") if name.strip()]
    wanted = {}
    known = all_cases()
    for name in names:
        if name in known:
            found = [known[name]]
        elif name in suite_names() or str(name).endswith(".toml"):
            found = read_suite(name).cases
        else:
            raise unknown("case", name, (*suite_names(), *known), "fowt list cases, fowt list suites")
        for case in found:
            wanted.setdefault(case.name, case)
    if not wanted:
        raise InputError("cases: none were named")
    return list(wanted.values())
