"""Defines the options of build_scene, with defaults and allowed values, fidelities and rotor models."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fowt_env.descriptions.checks import check_number, check_whole_number
from fowt_env.errors import InputError, unknown
from fowt_env.plant.aero.blade_elements import BladeElements
from fowt_env.plant.aero.coefficient_table import build_coefficient_table
from fowt_env.plant.aero.load import BemRotor
from fowt_env.plant.aero.section_inflow import build_dynamic_sections
from fowt_env.plant.aero.section_table import build_section_table
from fowt_env.plant.aero.tower_influence import POTENTIAL, SHADOW
from fowt_env.plant.aero.unsteady_airfoil import build_unsteady_airfoils
from fowt_env.plant.aero.wake import build_dynamic_inflow, build_skewed_wake, n_wake_states
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.plant.state import N_RIGID
from fowt_env.weather.second_order import METHODS


class RotorModel(NamedTuple):
    """Describes a rotor model."""

    summary: str
    build: Callable[[BladeElements, Mapping[str, Any]], Any]  # (elements, options) -> part of the model
    supports: tuple[str, ...]  # entries of STATION_OPTIONS
    full_field: bool  # whether blades sample a wind box point by point; else the rotor average is used
    error: float  # of a motion or tension at most, rms over its standard deviation: performance.md


class Fidelity(NamedTuple):
    """Defines the parts of a level of fidelity; an explicit option overrides a part."""

    summary: str
    rotor: str
    wave_loads: str
    integrator: str
    mooring: str
    radiation: str
    error: float  # of a motion or tension at most, rms over its standard deviation: performance.md
    dt: float | None = None  # s, default step with this integrator; None: default of the integrator
    blades: str = "rigid"
    tower: str = "rigid"
    shaft: str = "rigid"
    dynamic_inflow: bool = False


def least_lag(dt, integrator):
    """Return the shortest wake time constant (s) that an integrator resolves stably with the step dt (s)."""
    return LAG_MARGIN * dt / INTEGRATORS[integrator].decay_limit


def _wake_models(options):
    """Return (DynamicInflow or None, SkewedWake or None) of the options."""
    least = least_lag(default_step(options), options["integrator"])
    wake = build_dynamic_inflow(least=least) if options["dynamic_inflow"] else None
    return wake, build_skewed_wake() if options["skewed_wake"] else None


def _with_airfoils(elements, wake, options):
    """Return the BladeElements with UnsteadyAirfoils, whose states follow those of the wake; or unchanged."""
    if not options["unsteady_airfoils"]:
        return elements
    first = N_RIGID + n_wake_states(elements, wake)
    return elements._replace(airfoils=build_unsteady_airfoils(elements, first, default_step(options)))


def _build_bem(elements, options):
    wake, skew = _wake_models(options)
    return BemRotor(_with_airfoils(elements, wake, options), skew, wake)


def _build_lookup(elements, options):
    wake, skew = _wake_models(options)
    elements = _with_airfoils(elements, wake, options)
    if wake is None and skew is None and elements.airfoils is None:
        return build_section_table(elements)
    return build_dynamic_sections(elements, wake, skew)


WAKE_OPTIONS = ("dynamic_inflow", "skewed_wake")  # options that need the induced velocity
# options that need the flow at each blade station
STATION_OPTIONS = (*WAKE_OPTIONS, "unsteady_airfoils", "tower_potential", "tower_shadow")
ROTORS = {
    "bem": RotorModel(
        "blade-element momentum solved at every blade and station",
        _build_bem, supports=STATION_OPTIONS, full_field=True, error=0.0,
    ),
    "lookup": RotorModel(
        "the same sweep from a table per station",
        _build_lookup, supports=STATION_OPTIONS, full_field=True, error=2e-4,
    ),
    "table": RotorModel(
        "the whole rotor as one table",
        lambda elements, options: build_coefficient_table(elements),
        supports=(), full_field=False, error=2e-2,
    ),
}  # fmt: skip
FIDELITIES = {
    "reference": Fidelity(
        "everything solved exactly, Runge-Kutta 4",
        rotor="bem", wave_loads="exact", integrator="rk4", mooring="catenary",
        radiation="convolution", error=3e-6, dt=0.0125,
    ),
    "standard": Fidelity(
        "every blade and station by look-up, fast wave sums, Adams-Bashforth 4",
        rotor="lookup", wave_loads="fast", integrator="ab4", mooring="catenary",
        radiation="state_space", error=5e-4,
    ),
    "elastic": Fidelity(
        "standard with blades and tower that bend, a shaft that twists and a wake that lags",
        rotor="lookup", wave_loads="fast", integrator="ab4", mooring="catenary", radiation="state_space",
        error=5e-4, blades="modes2", tower="modes2", shaft="torsion",
        dynamic_inflow=True,
    ),
    "fast": Fidelity(
        "the rotor and the tensions of the lines as tables",
        rotor="table", wave_loads="fast", integrator="ab4", mooring="table", radiation="state_space",
        error=2e-2,
    ),
}  # fmt: skip
# frequency times step, for integrators without a stability limit: at half of this value an undamped
# oscillation grows with a damping ratio of -0.5 % (heun) or -0.04 % (abm4)
SLOW_GROWTH = 0.7
LAG_MARGIN = 1.25  # ratio of the shortest lag to the limit of stability
# s, largest default step with bending blades: errors below 1e-3 in the deviations of root moments. Half of it
# for a method of order 2, which feeds the lightly damped edgewise modes, and where blades that swing edgewise
# in phase, at 11 to 24 rad/s, are not advanced exactly (plant/elastic/in_phase.py): on a rigid shaft, and by
# Runge-Kutta methods
ELASTIC_STEP = 0.05
# largest square of the angle in a step of a nacelle that blades in phase on a twisting shaft move, of 0.05 s
# with the NREL 5 MW turbine: 0.12 on OC3-Hywind; 0.23 on the OC4 semi-submersible, where they swing without
# limit
NACELLE = 0.15
FIELD_SAMPLES = 3  # rotor loads per step in a wind box, whose cells the blades cross in 0.1 s


class Range(NamedTuple):
    """Defines the range of numbers allowed for an option."""

    text: str
    low: float
    high: float
    low_open: bool = False  # whether the lower limit is excluded
    whole: bool = False

    def __str__(self):
        return self.text

    def check(self, name, value):
        """Return the value as a number. Raises: InputError."""
        if self.whole:
            return check_whole_number(name, value, self.low, self.high)
        return check_number(name, value, self.low, self.high, low_open=self.low_open)


class Option(NamedTuple):
    """Defines an option of build_scene."""

    default: Any
    allowed: tuple | Range | str  # the values, or their description in words
    summary: str


OPTIONS = {
    "kinematics_position": Option("instantaneous", ("instantaneous", "fixed"),
        "where waves are evaluated: at the moving hull, or at rest"),
    "surface": Option("instantaneous", ("instantaneous", "swl"),
        "water surface of buoyancy and waves: instantaneous, or still-water level (swl)"),
    "stretching": Option("wheeler", ("wheeler", "none"), "wave kinematics above still water"),
    "strip_axis": Option("displaced", ("displaced", "undisplaced"),
        "axes of the strips of hull and members: as they tilt, or at rest, as in HydroDyn"),
    "diffraction": Option(None, (None, "none", "maccamy_fuchs"),
        "correction of wave loads on a large column; None: the platform's"),
    "skewed_wake": Option(False, (False, True), "induction over the azimuth in yawed or tilted inflow"),
    "dynamic_inflow": Option(None, (None, False, True),
        "lag of the wake behind changes of thrust; None: the fidelity's"),
    "unsteady_airfoils": Option(False, (False, "hgm"),
        "lag of lift and drag behind the angle of attack: Beddoes-Leishman model with four states (hgm)"),
    "tower_potential": Option(False, POTENTIAL,
        "potential flow around the tower at the blades, also with the correction of Bak"),
    "tower_shadow": Option(False, SHADOW, "wake behind the tower at the blades"),
    "tower_drag": Option(True, (False, True), "wind drag of the tower"),
    "hydrodynamics": Option(True, (False, True), "all loads of the water"),
    # True: that of the fidelity; "table": tensions tabulated about rest, solved outside the table; "dynamic":
    # lumped masses of [[lines]] with dynamics
    "mooring": Option(True, (False, True, "catenary", "table", "dynamic"),
        "lines: catenary solved at each step, a table of tensions, moving lines (dynamic), or none"),
    "line_segments": Option(None, Range("None (the platform file's) or 4 to 500", 4, 500, whole=True),
        "segments of each moving line (mooring dynamic)"),
    "planar": Option(False, (False, True), "motion in the vertical plane of the wind alone"),
    "pitch": Option("collective", ("collective", "individual"),
        "blades pitch together, or independently (individual pitch control)"),
    # "second_order": [pitch_drive.second_order] of the turbine file; "file": [pitch_drive] of the file
    "pitch_drive": Option("file", ("file", "second_order"),
        "first-order drive of the turbine file, or its second-order one"),
    # tower bending: none, or the first one or two modes in each direction ([tower.modes] of the file)
    "tower": Option(None, (None, "rigid", "modes", "modes2"),
        "rigid, or with one or two bending modes in each direction; None: the fidelity's"),
    # blade bending: none, or the modes of blade_beam.MODES ([blade_structure] of the turbine file)
    "blades": Option(None, (None, "rigid", "modes", "modes2"),
        "rigid, or with the first flapwise and edgewise bending mode of each blade, or two flapwise modes;"
        " None: the fidelity's"),
    # torsion of the shaft between generator and rotor ([shaft_torsion] of the turbine file)
    "shaft": Option(None, (None, "rigid", "torsion"),
        "rigid, or twisting between generator and rotor; None: the fidelity's"),
    "integrator": Option(None, (None, *INTEGRATORS), "time stepping; None: the fidelity's"),
    # of the rotor load per step; None: FIELD_SAMPLES in a wind box with an integrator that samples it, else 1
    "rotor_samples": Option(None, Range("None or a number of samples, 1 to 10", 1, 10, whole=True),
        "rotor loads per step of an integrator that samples them"),
    "wave_loads": Option(None, (None, "exact", "fast"),
        "sums over wave components: exact or fast; None: the fidelity's"),
    "radiation": Option(None, (None, "state_space", "convolution", "none"),
        "radiation memory of a potential-flow body; None: the fidelity's"),
    "radiation_error": Option(0.02, Range(
        "rms error of each entry of the state space over its rms, 0.001 to 0.5", 0.001, 0.5),
        "error of the state space fitted to the radiation memory"),
    "current": Option(None, "None, a speed (m/s) or {'speed', 'heading' (deg), 'exponent'}", "water current"),
    "excitation_position": Option("undisplaced", ("undisplaced", "filtered"),
        "where waves act on a potential-flow body: at rest, or following its slow drift"),
    "excitation_cutoff": Option(0.01, Range("Hz, 0.0001 to 0.5", 1e-4, 0.5), "low-pass cut-off of the drift"),
    "second_order": Option(None, (None, "none", *METHODS),
        "second-order wave forces of a potential-flow body: of differences; full_sum: and sums"),
    "second_order_cutoff": Option(None, Range("None or rad/s, > 0", 0.0, 100.0, low_open=True),
        "difference frequency above which the force is zero"),
    "duration": Option(700.0, Range("seconds of random wind and sea, > 0", 0.0, 1e6, low_open=True),
        "length of random wind and sea"),
    "wave_components": Option(None, Range(
        "None or a number of components, 1 to 10000", 1, 10_000, whole=True),
        "components of an irregular sea; None: as many as the duration requires"),
    "blade_stations": Option(None, "None (the turbine file's) or a number of them, 3 up to the file's",
        "blade stations of the rotor model"),
    "strip_length": Option(None, Range(
        "None (fraction of the draft) or metres, 0.01 to 1000: cells of exact wave loads", 0.01, 1e3),
        "length of the hull's strips"),
    "shear_exponent": Option(None, Range("None (the platform file's) or 0 to 1", 0.0, 1.0),
        "exponent of the power-law wind profile"),
    "turbine": Option(None, "None (the platform file's), a name, a path or a descriptions.turbine.Turbine",
        "replaces the turbine of the platform"),
}  # fmt: skip
# defaults of a floater other than a slender spar: linear theory is valid for the undisplaced pose only
UNDISPLACED = {"kinematics_position": "fixed", "surface": "swl", "stretching": "none"}
LEVEL_PARTS = ("wave_loads", "integrator", "radiation", "blades", "tower", "shaft", "dynamic_inflow")
ARGUMENTS = ("platform", "wind", "sea", "seed", "rotor", "fidelity", "loads")  # and OPTIONS


def choose_parts(fidelity, rotor, options):
    """Return the rotor model of a fidelity, and set the other unspecified parts in options."""
    if fidelity not in tuple(FIDELITIES):  # which may be unhashable
        raise unknown("fidelity", fidelity, FIDELITIES)
    level = FIDELITIES[fidelity]
    if rotor is not None and rotor not in tuple(ROTORS):
        raise unknown("rotor model", rotor, ROTORS)
    options["fidelity"] = fidelity
    options["explicit_wave_loads"] = options["wave_loads"] is not None
    for part in LEVEL_PARTS:
        if options[part] is None:
            options[part] = getattr(level, part)
    # a fidelity falls back to a model that supports these options, an explicit choice is rejected
    required = [name for name in STATION_OPTIONS if options[name]]
    able = [name for name, model in ROTORS.items() if set(required) <= set(model.supports)]
    if rotor is not None and rotor not in able:
        lacking = " and ".join(name for name in required if name not in ROTORS[rotor].supports)
        need = " or ".join(repr(name) for name in able)
        raise InputError(f"rotor = {rotor!r}: does not support {lacking}, which needs rotor = {need}")
    if options["mooring"] is True:
        options["mooring"] = level.mooring
    if options["blades"] != "rigid":
        able = [name for name in able if ROTORS[name].full_field]
        if rotor is not None and rotor not in able:
            raise InputError(
                f"rotor = {rotor!r}: tabulates the whole rotor with rigid blades;"
                f" blades = {options['blades']!r} needs rotor = {' or '.join(map(repr, able))}"
            )
        if options["planar"]:
            raise InputError(
                f"blades = {options['blades']!r}: bending blades shake the rotor sideways; a planar scene"
                " needs 'rigid' (or planar = False)"
            )
        options["pitch"] = "individual"
    if rotor is None:
        rotor = level.rotor if level.rotor in able else able[-1]  # the cheapest
    return rotor


def default_step(options, fastest=0.0, nacelle=0.0):
    """Return the default physics step (s) of the fidelity with its integrator, or of another integrator.

    fastest: largest natural frequency of the structure, rad/s. The step is halved until it is within half
    the integrator's stability limit of an undamped oscillation. nacelle: that of parts.nacelle_swing, rad/s.
    """
    level, method = FIDELITIES[options["fidelity"]], INTEGRATORS[options["integrator"]]
    default = level.dt is not None and options["integrator"] == level.integrator
    dt = level.dt if default else method.dt
    if options["blades"] != "rigid":
        short = method.order < 4 or options["shaft"] == "rigid" or not method.swings
        dt = min(dt, 0.5 * ELASTIC_STEP if short else ELASTIC_STEP)
    while dt * fastest > 0.5 * (method.oscillation_limit or SLOW_GROWTH) or (dt * nacelle) ** 2 > NACELLE:
        dt *= 0.5
    return dt


def checked_options(overrides, platform):
    """Return the checked options: defaults, overridden by the platform file, then by the caller."""
    options = {name: option.default for name, option in OPTIONS.items()}
    if platform.hull is None:
        options |= UNDISPLACED
    for source, values in (
        (f"platform {platform.name!r}, options", platform.options),
        ("build_scene", overrides),
    ):
        for name, value in values.items():
            if name not in OPTIONS:
                arguments = () if values is platform.options else ARGUMENTS
                raise unknown(f"option of {source}", name, (*OPTIONS, *arguments))
            allowed = OPTIONS[name].allowed
            if type(allowed) is tuple and not any(value is a or value == a for a in allowed):
                raise InputError(f"{name} = {value!r}: allowed {', '.join(repr(a) for a in allowed)}")
            options[name] = value
    for name, (default, allowed, _) in OPTIONS.items():
        if isinstance(allowed, Range) and (options[name], default) != (None, None):
            options[name] = allowed.check(name, options[name])
    return options


def samples_per_step(options, field):
    """Return the number of evaluations of the rotor load per step. Raises: InputError."""
    count, integrator = options["rotor_samples"], options["integrator"]
    able = INTEGRATORS[integrator].samples_rotor
    if count not in (None, 1) and not able:
        some = " or ".join(repr(name) for name, method in INTEGRATORS.items() if method.samples_rotor)
        raise InputError(
            f"rotor_samples = {count}: only integrator = {some} evaluates the rotor more than once a step,"
            f" not {integrator!r}"
        )
    if count is None:
        count = FIELD_SAMPLES if field is not None and able and options["blades"] == "rigid" else 1
    return count


def chosen_stations(count, turbine):
    """Return the indices of `count` of the file's blade stations, including first and last; None: all."""
    if count is None:
        return None
    known = len(turbine.blade.radius)
    check_whole_number("blade_stations", count, 3, known)
    return np.round(np.linspace(0, known - 1, count)).astype(int)
