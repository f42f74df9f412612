"""Describes a site: the joint climate of wind and sea, extremes, and what standards leave to the designer.

Wind: Weibull distribution of the mean wind. Sea, one of two forms:
fit     Hs | U Weibull and Tp | Hs, U log-normal, with parameters that are powers of wind speed and of Hs
        (Johannessen, Meling and Haver 2001; Li, Gao and Moan 2013), read from the file or fitted to a table
tables  expected Hs and Tp against wind speed, from sea_states.toml: one sea state for each wind

Conditional distributions are functions of U at the height of the file, a `Climate` is the site at a hub.
"""

from dataclasses import dataclass
from math import log
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field
from scipy.optimize import brentq
from scipy.special import gamma
from scipy.stats import lognorm, norm, weibull_min

from fowt_env.descriptions.files import locate, raise_problems, read_toml
from fowt_env.descriptions.iec import REFERENCE_SPEED, TURBULENCE_INTENSITY, extreme_speed
from fowt_env.descriptions.records import Finite, NonNegative, Positive, Record, bounded, checked_record
from fowt_env.descriptions.sea_state import joint_tables, read_sea_state, sea_states
from fowt_env.errors import unknown
from fowt_env.training.evaluation.cases import Site
from fowt_env.training.loads.site_fit import fitted
from fowt_env.training.loads.statistics import LIMITS

FOLDER = Path(__file__).parent / "sites"
YEAR = 8766.0  # h
WINDS = np.linspace(0.0, 80.0, 801)  # m/s, on which marginal distributions are integrated
HOUR_FACTOR = 0.95  # of a mean over an hour to one over ten minutes, in extreme wind
HOUR_SOURCE = (
    "IEC 61400-3-1: 1 h mean of the extreme wind is 0.95 of the 10 min mean; recalled, text not public"
)
# quantiles in the middle of classes of equal probability, on which the mean of a class is integrated
FINE = 50
Three = Annotated[tuple[Finite, Finite, Finite], Field()]
Probability = bounded(ge=0, le=1)
ClassOfWind = Literal[tuple(REFERENCE_SPEED)]
ClassOfTurbulence = Literal[tuple(TURBULENCE_INTENSITY)]


class Sourced(Record):
    """Provides the base of a part of a site file: where its figures come from, and how sure they are."""

    source: str
    confidence: str = ""


class Wind(Site):
    """Defines the wind of a site: Weibull distribution (A, k) of the mean wind at a height (m)."""

    confidence: str = ""
    height: Positive | None = None  # m; None: hub height
    profile_exponent: bounded(ge=0, le=1) = 0.1  # of the power law from `height` to the hub
    turbulence_class: ClassOfTurbulence = "B"
    turbine_class: ClassOfWind = "I"  # V_ave of the extreme turbulence model


class SeaFit(Sourced):
    """Defines the joint distribution of the sea and the wind U (m/s) at the height of the wind.

    Hs | U (m): Weibull with shape a1 + a2 U^a3 and scale b1 + b2 U^b3.
    Tp | Hs, U (s): log-normal with mean (e1 + e2 Hs^e3) (1 + slope ((U - V)/V)^power), V = f1 + f2 Hs^f3, and
    coefficient of variation k1 + k2 exp(k3 Hs).
    """

    shape: Three
    scale: Three
    period: Three
    spread: Three
    wind: Three = (1.0, 0.0, 1.0)
    slope: Finite = 0.0
    power: Positive = 1.0

    def _problems(self):
        for name, low in (("shape", 0.2), ("scale", 1e-3)):
            a, b, c = getattr(self, name)
            values = a + b * np.maximum(WINDS, 1e-9) ** c
            if not (values >= low).all():
                at = WINDS[np.argmax(~(values >= low))]
                yield f"{name} = {[a, b, c]}: is {np.min(values):.3g} at {at:g} m/s: must be at least {low:g}"
        heights = np.linspace(0.1, 25.0, 250)
        k1, k2, k3 = self.spread
        spread = k1 + k2 * np.exp(k3 * heights)
        if not ((spread > 0.0) & (spread < 2.0)).all():
            yield f"spread = {[k1, k2, k3]}: must give coefficients of variation in (0, 2) for Hs up to 25 m"
        e1, e2, e3 = self.period
        if not (e1 + e2 * heights**e3 > 0.5).all():
            yield f"period = {[e1, e2, e3]}: must give mean periods above 0.5 s for Hs up to 25 m"


class SeaTables(Sourced):
    """Defines the sea of a site by joint tables of sea_states.toml: the expected and the severe sea state."""

    normal: str
    severe: str

    def _problems(self):
        for name in (self.normal, self.severe):
            if name not in joint_tables():
                yield str(unknown("joint table", name, joint_tables()))


class Extreme(Sourced):
    """Defines conditions with a return period; what is missing follows from the joint distribution."""

    wind: Positive | None = None  # m/s, 10 min mean at the hub
    Hs: Positive | None = None  # m
    Tp: Positive | None = None  # s
    sea: str | None = None  # name of a sea state, in place of Hs and Tp
    current: NonNegative = 0.0  # m/s

    def _problems(self):
        if self.sea is not None and self.sea not in sea_states():
            yield str(unknown("sea state", self.sea, sea_states()))
        if self.sea is not None and (self.Hs is not None or self.Tp is not None):
            yield "sea: has Hs and Tp, so these must be left out"


class Current(Sourced):
    """Defines the current in normal conditions: speed (m/s) at the surface and exponent of its profile."""

    speed: NonNegative
    exponent: Positive = 1.0 / 7.0


class Direction(Record):
    """Defines a class of wind-wave misalignment (deg) and its probability in normal conditions."""

    misalignment: bounded(ge=-180, le=180)
    probability: Probability


class Design(Sourced):
    """Defines what a standard leaves to the designer.

    availability: fraction of time in which the turbine can operate. hs_classes, tp_classes: classes of equal
    probability of the sea for each wind, of a fitted sea. events: times per year, by kind of event. start:
    whose start-up is run, the supervisor's for all controllers or each controller's own. limits: of the
    constraints, by the names of LIMITS of statistics.py with _ for spaces; False: no limit.
    """

    availability: Probability = 0.95
    hs_classes: Annotated[int, Field(ge=1, le=50, strict=True)] = 3
    tp_classes: Annotated[int, Field(ge=1, le=50, strict=True)] = 1
    bin_width: bounded(ge=0.5, le=2.0) = 2.0  # m/s, of the wind; at most 2 m/s in the standards
    yaw_errors: tuple[bounded(ge=-30, le=30), ...] = (0.0,)  # deg, in production
    extreme_misalignments: tuple[bounded(ge=-180, le=180), ...] = (0.0,)  # deg, in the 1- and 50-year sea
    transient: Positive = 600.0  # s at the start of a run that are not counted
    start: Literal["supervisor", "controller"] = "supervisor"
    events: dict[Literal["start", "stop", "fault"], NonNegative] = {}
    limits: dict[str, Literal[False] | Finite] = {}

    def _problems(self):
        known = [name.replace(" ", "_") for name in LIMITS]
        for key in self.limits:
            if key not in known:
                yield f"limits: {unknown('constraint', key, known)}"

    @property
    def constraint_limits(self):
        """Return {constraint: limit} of `limits`, with None for no limit."""
        return {key.replace("_", " "): None if x is False else x for key, x in self.limits.items()}


class SiteFile(Record):
    """Defines the content of a site file. sea_fit or sea_tables or, with wind.A and k left out, table."""

    name: str
    description: str
    position: str = ""
    water_depth: Positive | None = None  # m; for a remark if that of the platform differs
    hours: Positive = 1.0  # h that a sea state lasts
    shear_exponent: bounded(ge=0, le=1) | None = None  # of the normal wind profile; None: the platform's
    wind: Wind
    sea_fit: SeaFit | None = None
    sea_tables: SeaTables | None = None
    current: Current | None = None
    extreme_1: Extreme | None = None
    extreme_50: Extreme | None = None
    direction: tuple[Direction, ...] = (Direction(misalignment=0.0, probability=1.0),)
    design: Design

    def _problems(self):
        if (self.sea_fit is None) == (self.sea_tables is None):
            yield "sea_fit, sea_tables: one of them is needed, and only one"
        total = sum(entry.probability for entry in self.direction)
        if abs(total - 1.0) > 1e-6:
            yield f"direction: the probabilities add up to {total:g}: must be 1"
        if self.sea_tables is not None and None in (self.extreme_1, self.extreme_50):
            yield "extreme_1, extreme_50: are needed with sea_tables, which have no distribution"


class Sea(NamedTuple):
    """Holds a sea state with its probability among those of one wind."""

    Hs: float  # m
    Tp: float  # s
    probability: float


@dataclass(frozen=True)
class Climate:
    """Represents a site at a hub height: distributions of wind, Hs and Tp, expected and extreme conditions.

    All winds are means (m/s) at the hub. Arrays broadcast.
    """

    site: SiteFile
    hub_height: float  # m
    cut_out: float = 25.0  # m/s, up to which tables are extended with their last row

    @property
    def ratio(self):
        """Return the wind at the hub over that at the height of the site file."""
        wind = self.site.wind
        return 1.0 if wind.height is None else (self.hub_height / wind.height) ** wind.profile_exponent

    def below(self, speed):
        """Return the probability of a mean wind below a speed."""
        wind = self.site.wind
        return -np.expm1(-((np.maximum(speed, 0.0) / (wind.A * self.ratio)) ** wind.k))

    def wind_at(self, probability):
        """Return the wind that is not exceeded with a probability."""
        wind = self.site.wind
        return wind.A * self.ratio * (-np.log1p(-np.asarray(probability))) ** (1.0 / wind.k)

    def height_below(self, Hs, speed):
        """Return the probability of a significant wave height below Hs in a wind; of tables: 0 or 1."""
        if self.site.sea_tables is not None:
            return np.where(np.asarray(Hs) < self._tabulated(speed, "normal")[0], 0.0, 1.0)
        shape, scale = self._height_parameters(speed)
        return weibull_min.cdf(Hs, shape, scale=scale)

    def height_at(self, probability, speed):
        """Return the Hs that is not exceeded with a probability in a wind; of tables: the expected Hs."""
        if self.site.sea_tables is not None:
            return np.broadcast_arrays(self._tabulated(speed, "normal")[0], probability)[0]
        shape, scale = self._height_parameters(speed)
        return scale * (-np.log1p(-np.asarray(probability))) ** (1.0 / shape)

    def period_at(self, probability, Hs, speed):
        """Return the Tp that is not exceeded with a probability at an Hs and a wind; of tables: the row's."""
        if self.site.sea_tables is not None:
            return np.broadcast_arrays(self._tabulated(speed, "normal")[1], probability)[0]
        mean, spread = self._period_parameters(Hs, speed)
        deviation = np.sqrt(np.log1p(spread**2))
        return lognorm.ppf(probability, deviation, scale=mean / np.sqrt(1.0 + spread**2))

    def _height_parameters(self, speed):
        fit, reference = self.site.sea_fit, np.maximum(np.asarray(speed) / self.ratio, 1e-9)
        return (a + b * reference**c for a, b, c in (fit.shape, fit.scale))

    def _period_parameters(self, Hs, speed):
        fit, Hs = self.site.sea_fit, np.maximum(np.asarray(Hs, dtype=float), 1e-3)
        (e1, e2, e3), (f1, f2, f3), (k1, k2, k3) = fit.period, fit.wind, fit.spread
        usual = f1 + f2 * Hs**f3
        relative = (np.asarray(speed) / self.ratio - usual) / usual
        bent = np.sign(relative) * np.abs(relative) ** fit.power
        # far from the data a steep slope would give no period
        mean = (e1 + e2 * Hs**e3) * np.maximum(1.0 + fit.slope * bent, 0.2)
        return mean, k1 + k2 * np.exp(k3 * Hs)

    def _tabulated(self, speed, which):
        """Return (Hs, Tp) of a joint table, beyond its ends those of its first or last row."""
        table = joint_tables()[getattr(self.site.sea_tables, which)]
        winds = np.clip(speed, table.wind[0], table.wind[-1])
        return np.interp(winds, table.wind, table.Hs), np.interp(winds, table.wind, table.Tp)

    def expected_sea(self, speed):
        """Return (Hs, Tp) of the normal sea state: the expected Hs in a wind, and the mean Tp of that Hs."""
        if self.site.sea_tables is not None:
            return tuple(map(float, self._tabulated(speed, "normal")))
        shape, scale = self._height_parameters(speed)
        Hs = float(scale * gamma(1.0 + 1.0 / shape))
        return Hs, float(self._period_parameters(Hs, speed)[0])

    def severe_sea(self, speed, years=50.0):
        """Return (Hs, Tp) of the severe sea state: Hs in a wind on the contour of a return period.

        The contour is that of inverse FORM (Winterstein et al. 1993): the wind has the normal variate u1 and
        Hs the variate sqrt(beta^2 - u1^2), beta of one sea state in `years`.
        """
        if self.site.sea_tables is not None:
            return tuple(map(float, self._tabulated(speed, "severe")))
        beta = norm.isf(1.0 / self.states(years))
        u1 = norm.ppf(self.below(speed))
        Hs = float(self.height_at(norm.cdf(np.sqrt(max(beta**2 - u1**2, 0.0))), speed))
        return Hs, float(self._period_parameters(Hs, speed)[0])

    def states(self, years):
        """Return the number of sea states in some years."""
        return years * YEAR / self.site.hours

    def extreme(self, years):
        """Return (wind, Hs, Tp, current, source) of a return period of 1 or 50 years, the wind of 10 min.

        What the site file does not give follows from the joint distribution: the marginal quantiles of the
        wind (a mean over an hour is converted to one over ten minutes by HOUR_FACTOR) and of Hs, and the mean
        Tp at these.
        """
        given = self.site.extreme_50 if years == 50 else self.site.extreme_1
        wind = Hs = Tp = None
        current, sources = 0.0, []
        if given is not None:
            wind, Hs, Tp, current = given.wind, given.Hs, given.Tp, given.current
            sources.append(given.source)
            if given.sea is not None:
                state = read_sea_state(given.sea)
                Hs, Tp = state.Hs, state.Tp
        if None in (wind, Hs, Tp):
            sources.append("joint distribution of the site")
        if wind is None and self.site.sea_tables is not None:
            wind = extreme_speed(self.site.wind.turbine_class, years, turbulent=True)
        elif wind is None:
            wind = float(self.wind_at(1.0 - 1.0 / self.states(years)))
            wind /= HOUR_FACTOR if self.site.hours >= 1.0 else 1.0
        if Hs is None:
            Hs = self.marginal_height(1.0 / self.states(years))
        if Tp is None:
            Tp = float(self._period_parameters(Hs, wind)[0])
        return wind, Hs, Tp, current, "; ".join(sources)

    def marginal_height(self, exceedance):
        """Return the Hs that is exceeded with a probability in all winds."""
        share = np.diff(self.below(WINDS))
        middle = 0.5 * (WINDS[1:] + WINDS[:-1])

        def excess(Hs):
            return log(max(float(share @ (1.0 - self.height_below(Hs, middle))), 1e-300)) - log(exceedance)

        return float(brentq(excess, 1e-3, 60.0, xtol=1e-6))

    def seas(self, speed):
        """Return the Seas of a wind: classes of equal probability, with mean Hs and quantiles of Tp."""
        if self.site.sea_tables is not None:
            return [Sea(*self.expected_sea(speed), 1.0)]
        design = self.site.design
        count, periods = design.hs_classes, design.tp_classes
        fine = self.height_at((np.arange(count * FINE) + 0.5) / (count * FINE), speed)
        found = []
        for Hs in fine.reshape(count, FINE).mean(axis=1):
            for quantile in (np.arange(periods) + 0.5) / periods:
                Tp = float(self.period_at(quantile, Hs, speed))
                found.append(Sea(float(Hs), Tp, 1.0 / (count * periods)))
        return found

    def sample(self, count, generator):
        """Return (wind, Hs, Tp), each (count,), of independent states drawn from the joint distribution."""
        first, second, third = generator.random((3, count))
        wind = self.wind_at(first)
        Hs = self.height_at(second, wind)
        return wind, Hs, self.period_at(third, Hs, wind)


def site_names():
    """Return the names of the built-in sites, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def read_site(name_or_path):
    """Return the SiteFile of a built-in name, of a TOML file or of a CSV table of sea states.

    A TOML file may have `table`, the path of such a table, in place of wind.A, wind.k and the sea. A table
    has the columns wind (m/s), Hs (m), Tp (s) and, if rows are not single records, probability or count;
    without a site file its wind is taken to be at hub height.
    Raises: InputError with a line per wrong entry.
    """
    if isinstance(name_or_path, SiteFile):
        return name_or_path
    if str(name_or_path).lower().endswith(".csv"):
        path = Path(name_or_path).expanduser()
        data = {"name": path.stem, "description": f"fit to {path.name}", "wind": {}, "design": {}}
        data["design"]["source"] = "defaults of this program"
        return checked_record(SiteFile, _with_fit(data, path), f"site table {str(path)!r}")
    path = Path(
        locate("site", name_or_path, site_names(), lambda name: FOLDER / f"{name}.toml", also="a .csv table")
    )
    data, where = read_toml(path, "site"), f"site file {str(path)!r}"
    if "table" in data:
        taken = [key for key in ("sea_fit", "sea_tables") if key in data]
        taken += [f"wind.{key}" for key in ("A", "k") if key in data.get("wind", {})]
        if taken:
            raise_problems(where, [f"table: gives {', '.join(taken)}, which must be left out"])
        table = data.pop("table")
        if not isinstance(table, str):
            raise_problems(where, [f"table = {table!r}: must be the path of a .csv file"])
        data = _with_fit(data, path.parent / Path(table).expanduser())
    return checked_record(SiteFile, data, where)


def _with_fit(data, path):
    """Return the data of a site file with wind and sea fitted to the table of a path."""
    wind, sea, source = fitted(path)
    given = data.get("wind", {})
    wind = {**wind, "source": source, **(given if isinstance(given, dict) else {})}
    return {**data, "wind": wind, "sea_fit": {**sea, "source": source}}


def climate_of(site, turbine):
    """Return the Climate of a site file at the hub of a turbine."""
    return Climate(site, turbine.rotor.hub_height, turbine.cut_out_wind_speed)
