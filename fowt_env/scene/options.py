"""Options of build_scene: fidelities, rotor models, single parts; their defaults and what is allowed."""

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
from fowt_env.plant.aero.wake import build_dynamic_inflow, build_skewed_wake
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.weather.second_order import METHODS


class RotorModel(NamedTuple):
    """A model of the rotor, and what is known of it."""

    summary: str
    build: Callable[[BladeElements, Mapping[str, Any]], Any]  # (elements, options) -> part of the model
    wake: tuple[str, ...]  # the options of the wake that it takes, of WAKE_OPTIONS
    full_field: bool  # whether blades meet a box of wind point by point; else its average over the rotor
    error: float  # of a motion or tension at most, rms over its standard deviation: performance.md


class Fidelity(NamedTuple):
    """Parts that a level of fidelity chooses; any of them given explicitly overrides its part."""

    summary: str
    rotor: str
    wave_loads: str
    integrator: str
    mooring: str
    radiation: str
    error: float  # of a motion or tension at most, rms over its standard deviation: performance.md
    dt: float | None = None  # s, default step with its own integrator; None: that of the integrator


def least_lag(dt, integrator):
    """Return the shortest time constant (s) of the wake that an integrator follows with the step dt (s)."""
    return LAG_MARGIN * dt / INTEGRATORS[integrator].decay_limit


def _build_wake(options):
    return build_dynamic_inflow(least=least_lag(default_step(options), options["integrator"]))


def _build_bem(elements, options):
    skew = build_skewed_wake() if options["skewed_wake"] else None
    wake = _build_wake(options) if options["dynamic_inflow"] else None
    return BemRotor(elements, skew, wake)


def _build_lookup(elements, options):
    if options["dynamic_inflow"]:
        return build_dynamic_sections(elements, _build_wake(options))
    return build_section_table(elements)


WAKE_OPTIONS = ("dynamic_inflow", "skewed_wake")  # what asks for the induced velocity
ROTORS = {
    "bem": RotorModel(
        "blade-element momentum solved at every blade and station",
        _build_bem, wake=WAKE_OPTIONS, full_field=True, error=0.0,
    ),
    "lookup": RotorModel(
        "the same sweep from a table per station",
        _build_lookup, wake=("dynamic_inflow",), full_field=True, error=2e-4,
    ),
    "table": RotorModel(
        "the whole rotor as one table",
        lambda elements, options: build_coefficient_table(elements),
        wake=(), full_field=False, error=2e-2,
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
    "fast": Fidelity(
        "the rotor and the tensions of the lines as tables",
        rotor="table", wave_loads="fast", integrator="ab4", mooring="table", radiation="state_space",
        error=2e-2,
    ),
}  # fmt: skip
# frequency times step, in place of a limit of stability that an integrator lacks: at half of it an undamped
# oscillation grows as one with a damping ratio of -0.5 % by heun, of -0.04 % by abm4
SLOW_GROWTH = 0.7
LAG_MARGIN = 1.25  # of the shortest lag over what just does not grow
FIELD_SAMPLES = 3  # rotor loads per step in a box of wind, whose cells the blades cross in 0.1 s
OPTIONS = {
    # name: (default, allowed values or a description of the allowed range)
    "kinematics_position": ("instantaneous", ("instantaneous", "fixed")),
    "surface": ("instantaneous", ("instantaneous", "swl")),
    "stretching": ("wheeler", ("wheeler", "none")),
    "diffraction": (None, (None, "none", "maccamy_fuchs")),
    "skewed_wake": (False, (False, True)),
    "dynamic_inflow": (False, (False, True)),
    "tower_drag": (True, (False, True)),
    "hydrodynamics": (True, (False, True)),
    # True: the fidelity's; "table": tensions tabulated about rest, solved beyond
    "mooring": (True, (False, True, "catenary", "table")),
    "planar": (False, (False, True)),
    "pitch": ("collective", ("collective", "individual")),  # of the blades
    # "second_order": that of [pitch_drive.second_order] of the turbine file; "file": the file's [pitch_drive]
    "pitch_drive": ("file", ("file", "second_order")),
    # bending of the tower: none, or its first mode or first two in each direction ([tower.modes] of the file)
    "tower": ("rigid", ("rigid", "modes", "modes2")),
    "integrator": (None, (None, *INTEGRATORS)),  # None: the fidelity's
    # of the rotor's load per step, of an integrator that samples it; None: FIELD_SAMPLES in a box, else 1
    "rotor_samples": (None, "None or a number of samples, 1 to 10"),
    "wave_loads": (None, (None, "exact", "fast")),  # None: the fidelity's
    # of a potential-flow body; None: the fidelity's
    "radiation": (None, (None, "state_space", "convolution", "none")),
    "radiation_error": (0.02, "rms error of each entry of the state space over its rms, 0.001 to 0.5"),
    "current": (None, "None, a speed (m/s) or {'speed', 'heading' (deg), 'exponent'}"),
    # where waves meet a potential-flow body: at rest, or at its surge and sway behind a low pass
    "excitation_position": ("undisplaced", ("undisplaced", "filtered")),
    "excitation_cutoff": (0.01, "Hz, 0.0001 to 0.5"),
    # of a potential-flow body with a difference-frequency QTF; cutoff: differences above it make no force
    "second_order": (None, (None, "none", *METHODS)),
    "second_order_cutoff": (None, "None or rad/s, > 0"),
    "duration": (700.0, "seconds of random wind and sea, > 0"),
    "wave_components": (None, "None or a number of components, 1 to 10000"),
    "blade_stations": (None, "None (the turbine file's) or a number of them, 3 up to the file's"),
    "strip_length": (None, "None (fraction of the draft) or metres, 0.01 to 1000: cells of exact wave loads"),
    "shear_exponent": (None, "None (the platform file's) or 0 to 1"),
    "turbine": (None, "None (the platform file's), a name, a path or a descriptions.turbine.Turbine"),
}
# defaults of a floater that is no slender spar: linear theory knows it in its undisplaced pose alone
UNDISPLACED = {"kinematics_position": "fixed", "surface": "swl", "stretching": "none"}
ARGUMENTS = ("platform", "wind", "sea", "seed", "rotor", "fidelity", "loads")  # of build_scene beside OPTIONS


def choose_parts(fidelity, rotor, options):
    """Rotor model of a fidelity, with the other parts filled into options where they were left open."""
    if fidelity not in tuple(FIDELITIES):  # which may be unhashable
        raise unknown("fidelity", fidelity, FIDELITIES)
    level = FIDELITIES[fidelity]
    if rotor is not None and rotor not in tuple(ROTORS):
        raise unknown("rotor model", rotor, ROTORS)
    # not every table has what a wake needs; a level falls back to what has it, an explicit choice is rejected
    wanted = [name for name in WAKE_OPTIONS if options[name]]
    able = [name for name, model in ROTORS.items() if set(wanted) <= set(model.wake)]
    if rotor is not None and rotor not in able:
        lacking = " and ".join(name for name in wanted if name not in ROTORS[rotor].wake)
        need = " or ".join(repr(name) for name in able)
        raise InputError(f"rotor = {rotor!r}: it has no {lacking}, which needs rotor = {need}")
    options["fidelity"] = fidelity
    options["explicit_wave_loads"] = options["wave_loads"] is not None
    for part in ("wave_loads", "integrator", "radiation"):
        if options[part] is None:
            options[part] = getattr(level, part)
    if options["mooring"] is True:
        options["mooring"] = level.mooring
    if rotor is None:
        rotor = level.rotor if level.rotor in able else able[-1]  # the cheapest
    return rotor


def default_step(options, fastest=0.0):
    """Default physics step (s): that of the fidelity with its own integrator, else that of the integrator.

    fastest: largest natural frequency of the structure, rad/s. The step is halved until it is within half
    the integrator's limit for an undamped oscillation.
    """
    level, method = FIDELITIES[options["fidelity"]], INTEGRATORS[options["integrator"]]
    own = level.dt is not None and options["integrator"] == level.integrator
    dt = level.dt if own else method.dt
    while dt * fastest > 0.5 * (method.oscillation_limit or SLOW_GROWTH):
        dt *= 0.5
    return dt


def checked_options(given, platform):
    """Return the options with defaults, the platform file's own ones and the caller's, checked."""
    options = {name: default for name, (default, _) in OPTIONS.items()}
    if platform.hull is None:
        options |= UNDISPLACED
    for source, values in (
        (f"platform {platform.name!r}, options", platform.options),
        ("build_scene", given),
    ):
        for name, value in values.items():
            if name not in OPTIONS:
                own = () if values is platform.options else ARGUMENTS
                raise unknown(f"option of {source}", name, (*OPTIONS, *own))
            allowed = OPTIONS[name][1]
            if isinstance(allowed, tuple) and not any(value is a or value == a for a in allowed):
                raise InputError(f"{name} = {value!r}: allowed {', '.join(repr(a) for a in allowed)}")
            options[name] = value
    options["duration"] = check_number("duration", options["duration"], 0.0, 1e6, low_open=True)
    if options["shear_exponent"] is not None:
        options["shear_exponent"] = check_number("shear_exponent", options["shear_exponent"], 0.0, 1.0)
    if options["strip_length"] is not None:
        options["strip_length"] = check_number("strip_length", options["strip_length"], 0.01, 1e3)
    options["radiation_error"] = check_number("radiation_error", options["radiation_error"], 0.001, 0.5)
    options["excitation_cutoff"] = check_number("excitation_cutoff", options["excitation_cutoff"], 1e-4, 0.5)
    if options["second_order_cutoff"] is not None:
        options["second_order_cutoff"] = check_number(
            "second_order_cutoff", options["second_order_cutoff"], 0.0, 100.0, low_open=True
        )
    for name, most in (("wave_components", 10000), ("rotor_samples", 10)):
        if options[name] is not None:
            options[name] = check_whole_number(name, options[name], 1, most)
    return options


def samples_per_step(options, field):
    """Return the evaluations of the rotor's load per step."""
    asked, integrator = options["rotor_samples"], options["integrator"]
    able = INTEGRATORS[integrator].samples_rotor
    if asked not in (None, 1) and not able:
        some = " or ".join(repr(name) for name, method in INTEGRATORS.items() if method.samples_rotor)
        raise InputError(
            f"rotor_samples = {asked}: only integrator = {some} evaluates the rotor more than once a step,"
            f" not {integrator!r}"
        )
    if asked is None:
        asked = FIELD_SAMPLES if field is not None and able else 1
    return asked


def chosen_stations(count, turbine):
    """Return the indices of that many of the file's blade stations, root and tip among them; None: all."""
    if count is None:
        return None
    known = len(turbine.blade.radius)
    check_whole_number("blade_stations", count, 3, known)
    return np.round(np.linspace(0, known - 1, count)).astype(int)
