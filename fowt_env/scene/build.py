"""From descriptions to a scene: everything that a run needs, checked, typed and built once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import cos, radians, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fowt_env.descriptions.platform import Platform, Turbine, read_platform, read_turbine, sea_state_of
from fowt_env.descriptions.sea_state import SeaState
from fowt_env.errors import InputError, unknown
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.coefficient_table import build_rotor_table
from fowt_env.plant.aero.load import Aero, BemRotor
from fowt_env.plant.aero.section_table import build_section_table
from fowt_env.plant.aero.tower_drag import build_tower_drag
from fowt_env.plant.aero.wake import build_dynamic_inflow, build_skewed_wake, n_wake_states
from fowt_env.plant.aero.wind import WindSeries
from fowt_env.plant.channels import Channel, Layout, channels, to_units, with_hub_wind
from fowt_env.plant.compile.handle import Handle
from fowt_env.plant.drivetrain import build_drivetrain, build_pitch_actuator, build_torque_limits
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.hydro.added_inertia import build_added_inertia
from fowt_env.plant.hydro.diffraction import build_strip_diffraction
from fowt_env.plant.hydro.hydrostatics import build_hull
from fowt_env.plant.hydro.linear_damping import build_damping
from fowt_env.plant.hydro.load import BandedStrips, ExactStrips, Hydro
from fowt_env.plant.hydro.morison import Current, build_strips
from fowt_env.plant.hydro.wave_bands import (
    STILL_REFINEMENT,
    build_fast_waves,
    build_lane_diffraction,
    build_lanes,
    can_be_fast,
    fast_scratch,
)
from fowt_env.plant.integrators import INTEGRATORS, build_integrator, rotor_samples
from fowt_env.plant.model import N_CACHE, Data, Model, RigidBody
from fowt_env.plant.mooring import build_mooring
from fowt_env.plant.rotor_substeps import N_SAMPLE
from fowt_env.plant.state import N_RIGID, Block, state_blocks
from fowt_env.plant.user_loads import room_of
from fowt_env.scene.user_loads import Load, build_user_loads, checked_loads, first_nonfinite_load
from fowt_env.weather.waves import build_waves
from fowt_env.weather.wind import build_wind, hub_series, make_series, nominal_speed
from fowt_env.weather.wind_field import WindBox, hub_speed, hub_wind, is_field, read_box, rotor_average

# what users may give as wind and sea, see build_scene
Wind = float | dict[str, Any] | WindSeries | WindBox | None
Sea = str | Path | Mapping[str, Any] | SeaState | None

ROTORS = ("bem", "lookup", "table")
FIDELITIES = {
    # each level's parts; any of them given explicitly overrides its part
    "reference": {"rotor": "bem", "wave_loads": "exact", "integrator": "rk4", "mooring": "catenary"},
    "standard": {"rotor": "lookup", "wave_loads": "fast", "integrator": "ab4", "mooring": "catenary"},
    "fast": {"rotor": "table", "wave_loads": "fast", "integrator": "ab4", "mooring": "table"},
}
IN_PLANE = 1e-9  # share of a vector out of the plane of a planar scene that rounding may leave
FIELD_SAMPLES = 3  # rotor loads per step of ab4 in a box of wind, whose cells the blades cross in 0.1 s
SPAN_POINTS = 8  # along a blade, for the mean wind over the blades in the outputs
REFERENCE_STEP = 0.0125  # s, of rk4 at fidelity "reference": errs 2e-6 in heave, 2e-7 elsewhere
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
    "integrator": (None, (None, *INTEGRATORS)),  # None: the fidelity's
    # of the rotor's load per step of ab4; None: FIELD_SAMPLES in a box of wind, else 1
    "rotor_samples": (None, "None or a number of samples, 1 to 10"),
    "wave_loads": (None, (None, "exact", "fast")),  # None: the fidelity's
    "current": (None, "None, a speed (m/s) or {'speed', 'heading' (deg), 'exponent'}"),
    "duration": (700.0, "seconds of random wind and sea, > 0"),
    "wave_components": (None, "None or a number of components, 1 to 10000"),
    "blade_stations": (None, "None (the turbine file's) or a number of them, 3 up to the file's"),
    "strip_length": (None, "None (a share of the draft) or metres, 0.01 to 1000: cells of exact wave loads"),
    "shear_exponent": (None, "None (the platform file's) or 0 to 1"),
    "turbine": (None, "None (the platform file's), a name, a path or a descriptions.platform.Turbine"),
}
ARGUMENTS = ("platform", "wind", "sea", "seed", "rotor", "fidelity", "loads")  # of build_scene beside OPTIONS


@dataclass(frozen=True, eq=False)
class Scene:
    """A turbine on its platform in its weather, ready to be stepped.

    model is what kernels read; the rest says where it came from. Scenes are never written to: the
    state vector and the scratch of a run belong to the run.
    """

    model: Any  # a dynamics.Model; its parts have many types
    platform: Platform
    turbine: Turbine
    wind: Any  # as asked for
    sea: Any
    seed: int
    rotor: str
    options: dict
    wind_speed: float | None  # mean hub wind that a trim uses; None without aerodynamics
    loads: tuple[Load, ...] = ()  # the user's own
    label: str = ""  # the platform as it was asked for: name or path
    trims: dict = field(default_factory=dict, init=False, repr=False)  # {platform mode: OperatingPoint} found

    @property
    def n_lines(self) -> int:
        return 0 if self.model.mooring is None else self.model.mooring.length.shape[0]

    @property
    def load_names(self) -> tuple[str, ...]:
        return tuple(load.name for load in self.loads)

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """What the entries of this scene's state vector are, in order."""
        internal = {"wake": _wake_states(self.model.aero)}
        return state_blocks(internal | {f"load {load.name}": load.states for load in self.loads})

    @property
    def n_state(self) -> int:
        return self.blocks[-1].offset + self.blocks[-1].size

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Output channels of this scene, in row order."""
        return channels(self.n_lines, self.load_names)

    def values(self, rows: np.ndarray) -> np.ndarray:
        """A copy of output rows (k, n_channels), in SI as kernels write them, in the units of the channels.

        Where the plant's wind is a rotor average, Wind1VelX to Z become those of a point at the hub.
        """
        if self._hub_wind is not None:
            rows = with_hub_wind(rows, self._hub_wind, self.model.aero.wind.period)
        return to_units(rows, self.n_lines, self.load_names)

    @cached_property
    def _hub_wind(self):
        """(time, (n, 3)) of the wind at the hub where the model's wind is a rotor average, else None."""
        rotor = self.turbine.rotor
        if isinstance(self.wind, WindBox):
            return hub_wind(self.wind, rotor.hub_height) if self.model.aero.field is None else None
        found = hub_series(
            self.wind,
            reference_height=rotor.hub_height,
            rotor_diameter=2.0 * rotor.tip_radius,
            seed=self.seed,
            duration=self.options["duration"],
        )
        if found is not None and self.options["planar"]:
            found[1][:, 1] = 0.0
        return found

    def data(self) -> Data:
        """Fresh scratch arrays for one plant of this scene."""
        hydro = self.model.hydro
        strips = None if hydro is None else hydro.strips
        return Data(
            lines=np.zeros((self.n_lines, 6)),
            counters=np.zeros(N_COUNTERS),
            kinematics=np.zeros((7, 0 if strips is None else strips.shape.nodes)),
            fast=fast_scratch(getattr(strips, "sea", None), getattr(strips, "lanes", None)),
            added_mass=np.zeros((6, 6)),
            matrix=np.zeros((6, 6)),
            stages=np.zeros((5, self.n_state)),
            cache=np.zeros(N_CACHE),
            user=np.zeros(room_of(len(self.loads), max((load.states for load in self.loads), default=0))),
            history=np.zeros((4, self.n_state)),
            samples=np.zeros((4 * rotor_samples(self.model.integrator), N_SAMPLE)),
        )

    def handle(self, data: Data | None = None) -> Handle:
        """The model and data in the form that kernels take from Python."""
        return Handle(self.model, self.data() if data is None else data)

    def first_nonfinite_load(self, data: Data) -> str | None:
        """Words for the load of the user's that made a run not finite with this data; None where none did."""
        return first_nonfinite_load(self.loads, data.user)

    def with_weather(self, wind: Wind, sea: Sea, seed: int) -> "Scene":
        """A copy in other weather of the same kind: only wind and sea are drawn anew.

        Raises: InputError, also where aerodynamics would appear or vanish (build a scene for that).
        """
        seed = _seed(seed)
        air, waves = _weather(wind, sea, seed, self.platform, self.turbine, self.rotor, self.options)
        aero, hydro = self.model.aero, self.model.hydro
        if (air.series is None) != (aero is None):
            raise InputError(
                f"wind = {wind!r}: a scene cannot gain or lose its aerodynamics; use build_scene"
            )
        if aero is not None and (air.field is None) != (aero.field is None):
            raise InputError("wind: a scene cannot gain or lose its box of full-field wind; use build_scene")
        if hydro is not None:
            strips = _with_sea(hydro.strips, waves, self.options)
            hydro = hydro._replace(waves=waves, strips=strips)
        if aero is not None:
            aero = aero._replace(wind=air.series, field=air.field)
        model = self.model._replace(aero=aero, hydro=hydro)
        return replace(self, model=model, wind=air.spec, sea=sea, seed=seed, wind_speed=air.speed)

    @property
    def dt(self) -> float:
        """Default physics step, s: that of the scene's integrator, finer at fidelity "reference"."""
        if self.options["fidelity"] == "reference" and self.options["integrator"] == "rk4":
            return REFERENCE_STEP
        return INTEGRATORS[self.options["integrator"]].dt

    def with_model(self, parts: Mapping[str, Any] | None = None, **slots: Any) -> "Scene":
        """A copy with some parts of the model replaced (same types: no recompilation).

        parts: {path: part}, as {"hydro.damping": ...}; slots: those at the top, as rigid_body=...
        """
        model = self.model
        for path, part in {**(parts or {}), **slots}.items():
            model = _replaced(model, path.split("."), part)
        return replace(self, model=model)

    def __repr__(self):
        return (
            f"Scene({self.platform.name!r}, wind={self.wind!r}, sea={self.sea!r}, seed={self.seed},"
            f" rotor={self.rotor!r})"
        )


def _replaced(part, path, value):
    """A part of a model with that at a path of field names replaced."""
    name, *rest = path
    return part._replace(**{name: _replaced(getattr(part, name), rest, value) if rest else value})


def build_scene(
    platform: str | Path | Platform = "oc3_hywind",
    wind: Wind = None,
    sea: Sea = None,
    *,
    seed: int = 0,
    rotor: str | None = None,
    fidelity: str = "reference",
    loads: Sequence[Load] = (),
    **options: Any,
) -> Scene:
    """Scene of a platform, a wind and a sea.

    platform  built-in name, path to a TOML file, or a descriptions.platform.Platform
    wind      None: no aerodynamics; 0.0: still air; a speed (m/s); or a dict with "kind": steady,
              series, steps, eog, edc, ecd, ews, ewm, ntm, etm (weather/wind.py), or a box of full-field
              wind: bts, box, mann (weather/wind_field.py), rotor-averaged for rotor "table"
    sea       None: still water; a named sea state; or a dict with "kind": regular, jonswap,
              pierson_moskowitz, components
    seed      of everything random: the same seed gives the same bits
    rotor     "bem": blade-element momentum solved at every blade and station; "lookup": the same sweep
              from a table per station; "table": the whole rotor as one table. None: the fidelity's
    fidelity  "reference": everything solved exactly, Runge-Kutta 4; "standard": every blade and station
              by look-up, fast wave sums, Adams-Bashforth 4 (in a box of wind with three rotor loads per
              step); "fast": the rotor as one table
    loads     further loads on platform and tower, of one's own (fowt_env.Load)
    options   see OPTIONS; a platform file may set other defaults. planar: surge, heave and platform pitch
              alone move; of ntm and etm turbulence the part in the plane is kept

    Raises: InputError naming the key, the value and what is allowed.
    """
    label = platform.name if isinstance(platform, Platform) else str(platform)
    if not isinstance(platform, Platform):
        platform = read_platform(platform)
    chosen = _options(options, platform)
    turbine = chosen["turbine"] or platform.turbine
    if not isinstance(turbine, Turbine):
        turbine = read_turbine(turbine)
    rotor = _parts(fidelity, rotor, chosen)
    seed = _seed(seed)
    air, waves = _weather(wind, sea, seed, platform, turbine, rotor, chosen)
    current = _current(chosen["current"]) if chosen["hydrodynamics"] else None
    if chosen["planar"]:
        _check_symmetry(platform.lines if chosen["mooring"] else (), current)
    mooring = _mooring(platform.lines, chosen["mooring"])
    user = checked_loads(loads, 0 if mooring is None else mooring.length.shape[0], chosen["planar"])
    aero = None if air.series is None else _aero(platform, turbine, air, rotor, chosen)
    model = Model(
        rigid_body=build_rigid_body(platform, turbine, plane=True if chosen["planar"] else None),
        layout=build_layout(platform, turbine),
        drivetrain=build_drivetrain(turbine),
        actuator=build_pitch_actuator(turbine.pitch_drive),
        generator=build_torque_limits(turbine.torque_law),
        hydro=_hydro(platform, waves, current, chosen) if chosen["hydrodynamics"] else None,
        mooring=mooring,
        aero=aero,
        integrator=build_integrator(chosen["integrator"], _samples(chosen, air.field)),
        user=build_user_loads(user, platform.tower.base_height, N_RIGID + _wake_states(aero)),
    )
    return Scene(model, platform, turbine, air.spec, sea, seed, rotor, chosen, air.speed, user, label)


def _wake_states(aero):
    """Number of states of the wake of an Aero part or None."""
    rotor = None if aero is None else aero.rotor
    return n_wake_states(rotor.elements, rotor.wake) if isinstance(rotor, BemRotor) else 0


def _aero(platform, turbine, air, rotor, chosen):
    """Aero part of a scene with wind."""
    density = platform.environment.air_density
    elements = build_blade_elements(turbine, density, _stations(chosen["blade_stations"], turbine))
    if rotor == "bem":
        skew = build_skewed_wake() if chosen["skewed_wake"] else None
        wake = build_dynamic_inflow() if chosen["dynamic_inflow"] else None
        model = BemRotor(elements, skew, wake)
    else:
        model = build_section_table(elements) if rotor == "lookup" else build_rotor_table(elements)
    tower = build_tower_drag(platform.tower, density) if chosen["tower_drag"] else None
    return Aero(air.series, air.field, model, tower)


def _hydro(platform, waves, current, chosen):
    """Hydro part of a scene in water."""
    site = platform.environment
    shape = _strips(platform, chosen)
    strips = ExactStrips(shape, None)
    if _quick(chosen, waves, shape):
        lanes = build_lanes(platform.hull, shape, 1 if waves else STILL_REFINEMENT)
        strips = BandedStrips(shape, lanes, None, None)
    return Hydro(
        hull=build_hull(platform.hull, site.water_density, site.gravity),
        strips=_with_sea(strips, waves, chosen),
        waves=waves,
        current=current,
        damping=build_damping(platform.hydro),
        added_inertia=build_added_inertia(platform.hydro.added_mass),
    )


def _with_sea(strips, waves, chosen):
    """Strips in waves (None: still water). Raises: InputError for a sea beyond the fast path."""
    diffracting = chosen["diffraction"] == "maccamy_fuchs" and waves is not None
    if isinstance(strips, ExactStrips):
        return strips._replace(
            diffraction=build_strip_diffraction(waves, strips.shape) if diffracting else None
        )
    sea = _fast_sea(waves, strips.shape)
    return strips._replace(
        sea=sea, diffraction=build_lane_diffraction(sea, strips.lanes) if diffracting else None
    )


def _parts(fidelity, rotor, chosen):
    """Rotor model of a fidelity, with the other parts filled into chosen where they were left open."""
    if fidelity not in tuple(FIDELITIES):  # which may be unhashable
        raise unknown("fidelity", fidelity, FIDELITIES)
    level = FIDELITIES[fidelity]
    if rotor is not None and rotor not in ROTORS:
        raise unknown("rotor model", rotor, ROTORS)
    # induction is not in the tables; a level falls back to what has it, an explicit wish is refused
    needs_induction = chosen["dynamic_inflow"] or chosen["skewed_wake"]
    if needs_induction and rotor not in (None, "bem"):
        raise InputError(f"rotor = {rotor!r}: skewed_wake and dynamic_inflow need rotor = 'bem'")
    chosen["fidelity"] = fidelity
    chosen["explicit_wave_loads"] = chosen["wave_loads"] is not None
    for part in ("wave_loads", "integrator"):
        if chosen[part] is None:
            chosen[part] = level[part]
    if chosen["mooring"] is True:
        chosen["mooring"] = level["mooring"]
    if rotor is None:
        rotor = "bem" if needs_induction else level["rotor"]
    return rotor


def _quick(chosen, waves, strips):
    """Whether the strip loads take the fast path; where a level asks for it, seas beyond it go exact."""
    if chosen["wave_loads"] != "fast":
        return False
    if waves is None or can_be_fast(waves, strips):
        return True
    if chosen["explicit_wave_loads"]:
        raise InputError(
            "wave_loads = 'fast': needs waves of one heading, and surface 'instantaneous' with stretching"
            " 'wheeler' or surface 'swl' with stretching 'none'; use 'exact'"
        )
    return False


def _fast_sea(waves, strips):
    """FastWaves of the waves, None in still water. Raises: InputError for a sea beyond the fast path."""
    if waves is None:
        return None
    if not can_be_fast(waves, strips):
        raise InputError("sea: several headings cannot be summed fast; build_scene(..., wave_loads='exact')")
    return build_fast_waves(waves, strips)


def _options(given, platform):
    """Options with defaults, the platform file's own ones and the caller's, checked."""
    chosen = {name: default for name, (default, _) in OPTIONS.items()}
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
            chosen[name] = value
    chosen["duration"] = _number("duration", chosen["duration"], 0.0, 1e6, low_open=True)
    if chosen["shear_exponent"] is not None:
        chosen["shear_exponent"] = _number("shear_exponent", chosen["shear_exponent"], 0.0, 1.0)
    if chosen["strip_length"] is not None:
        chosen["strip_length"] = _number("strip_length", chosen["strip_length"], 0.01, 1e3)
    for name, most in (("wave_components", 10000), ("rotor_samples", 10)):
        count = chosen[name]
        if count is not None and not (_whole(count) and 1 <= count <= most):
            raise InputError(f"{name} = {count!r}: must be a whole number from 1 to {most}")
    return chosen


def _whole(value):
    """Whether a value is a whole number."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _samples(chosen, field):
    """Evaluations of the rotor's load per step."""
    asked, integrator = chosen["rotor_samples"], chosen["integrator"]
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


class _Air(NamedTuple):
    """Wind of a scene: what was asked for (a box once read), its parts, and the mean hub wind of a trim."""

    spec: object
    series: object  # WindSeries or None
    field: object  # WindField or None
    speed: float | None


def _air(wind, seed, turbine, rotor, shear, duration):
    """_Air of a wind specification."""
    hub, diameter = turbine.rotor.hub_height, 2.0 * turbine.rotor.tip_radius
    if not is_field(wind):
        series = build_wind(
            wind,
            reference_height=hub,
            rotor_diameter=diameter,
            shear_exponent=shear,
            seed=seed,
            duration=duration,
        )
        return _Air(wind, series, None, None if series is None else nominal_speed(wind))
    box = read_box(
        wind, hub_height=hub, rotor_diameter=diameter, shear_exponent=shear, seed=seed, duration=duration
    )
    speed = hub_speed(box, hub)
    like = {"reference_height": hub, "reference_length": diameter, "shear_exponent": 0.0}
    if rotor == "table":
        period = box.velocity.shape[0] * box.dt if box.periodic else 0.0
        return _Air(box, make_series(*rotor_average(box, hub, diameter), period=period, **like), None, speed)
    mean = make_series(np.zeros(1), np.array([[speed, 0.0, 0.0, 0.0, 0.0]]), **like)
    return _Air(box, mean, box.field(), speed)


def _weather(wind, sea, seed, platform, turbine, rotor, chosen):
    """(_Air, Waves or None) of a wind and sea specification."""
    site = platform.environment
    shear = site.shear_exponent if chosen["shear_exponent"] is None else chosen["shear_exponent"]
    air = _air(wind, seed, turbine, rotor, shear, chosen["duration"])
    if chosen["planar"]:
        air = _in_plane(air)
    state = sea_state_of(sea)
    _check_sea(state, site.water_depth)
    if not chosen["hydrodynamics"]:
        return air, None
    waves = build_waves(
        state,
        depth=site.water_depth,
        density=site.water_density,
        gravity=site.gravity,
        seed=seed,
        duration=chosen["duration"],
        components=chosen["wave_components"],
    )
    if chosen["planar"] and waves is not None and np.abs(waves.sin_heading).max() > IN_PLANE:
        raise InputError("sea: the heading must be 0 or 180 deg in a planar scene")
    return air, waves


def _in_plane(air):
    """The _Air of a planar scene; of turbulence the part in the plane. Raises: InputError for cross wind."""
    if air.series is None:
        return air
    if air.field is not None:
        raise InputError(
            "wind: a box of full-field wind is not planar; use rotor = 'table' or planar = False"
        )
    value = air.series.value.copy()
    across = np.abs(value[:, [1, 4]]).max()
    if across <= IN_PLANE * np.abs(value[:, 0]).max():
        return air
    kind = air.spec.get("kind") if isinstance(air.spec, dict) else getattr(air.spec, "kind", None)
    if kind not in ("ntm", "etm") or abs(value[:, 1].mean()) > 1e-3 * abs(value[:, 0].mean()):
        raise InputError(
            f"wind: cross wind or horizontal shear of up to {across:g} m/s; a planar scene has neither"
            " (planar = False)"
        )
    value[:, [1, 4]] = 0.0
    return air._replace(series=air.series._replace(value=value))


def _check_symmetry(lines, current):
    """Refuse what pulls a planar scene out of its plane."""
    if current is not None and abs(current.v) > IN_PLANE * abs(current.u):
        raise InputError("current.heading: must be 0 or 180 deg in a planar scene")
    mirror = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    rows = [
        np.array([*line.anchor, *line.fairlead, line.length, line.wet_weight, line.EA, line.seabed_friction])
        for line in lines
    ]
    for row in rows:
        if not any(np.allclose(other, mirror * row, rtol=1e-6, atol=1e-3) for other in rows):
            raise InputError(
                f"mooring line anchored at y = {row[1]:g} m has no mirror image at {-row[1]:g} m; a planar"
                " scene needs one (planar = False)"
            )


def _number(name, value, low, high, low_open=False):
    """The value as a float inside [low, high]. Raises: InputError."""
    good = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not good or not low <= value <= high or (low_open and value == low):  # NaN is in no range
        bracket = "(" if low_open else "["
        raise InputError(f"{name} = {value!r}: must be a number in {bracket}{low:g}, {high:g}]")
    return float(value)


def _stations(count, turbine):
    """Indices of that many of the file's blade stations, root and tip among them; None: all."""
    if count is None:
        return None
    known = len(turbine.blade.radius)
    if not (_whole(count) and 3 <= count <= known):
        raise InputError(f"blade_stations = {count!r}: must be a whole number from 3 to {known}")
    return np.round(np.linspace(0, known - 1, count)).astype(int)


def _seed(seed):
    if not (_whole(seed) and seed >= 0):
        raise InputError(f"seed = {seed!r}: must be a whole number >= 0")
    return int(seed)


def _check_sea(state, depth):
    """Refuse a sea that does not fit into the water."""
    if state is None:
        return
    if state.kind == "components":
        height = 2.0 * float(np.sum(state.amplitude))
    else:
        height = state.H if state.kind == "regular" else state.Hs
    if height is not None and height > depth:
        raise InputError(f"sea: wave height {height:g} m: must not exceed the water depth of {depth:g} m")


def _strips(platform, chosen):
    site = platform.environment
    return build_strips(
        platform.hull,
        platform.hydro,
        density=site.water_density,
        depth=site.water_depth,
        position=chosen["kinematics_position"],
        surface=chosen["surface"],
        stretching=chosen["stretching"],
        cell=chosen["strip_length"],
    )


def _current(spec):
    """Current part, or None where its speed is zero."""
    if spec is None:
        return None
    if not isinstance(spec, dict):
        spec = {"speed": spec}
    for key in spec:
        if key not in ("speed", "heading", "exponent"):
            raise unknown("key of current", key, ("speed", "heading", "exponent"))
    if "speed" not in spec:
        raise InputError("current: the key 'speed' (m/s) is missing")
    speed = _number("current.speed", spec["speed"], 0.0, 10.0)
    heading = radians(_number("current.heading", spec.get("heading", 0.0), -360.0, 360.0))
    exponent = _number("current.exponent", spec.get("exponent", 0.0), 0.0, 10.0)
    if speed == 0.0:
        return None
    return Current(speed * cos(heading), speed * sin(heading), exponent)


def _mooring(lines, wanted):
    """Mooring part, None without lines or where none is wanted."""
    return build_mooring(lines, tabulated=wanted == "table") if wanted else None


def assemble(bodies):
    """(6, 6) mass matrix about the body origin of rigid bodies (mass, centre (3,), inertia (3,) about it)."""
    matrix = np.zeros((6, 6))
    for mass, centre, inertia in bodies:
        x, y, z = centre
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        matrix[:3, :3] += mass * np.eye(3)
        matrix[:3, 3:] -= mass * cross
        matrix[3:, :3] += mass * cross
        matrix[3:, 3:] += np.diag(inertia) - mass * cross @ cross
    return matrix


def _upper_bodies(platform, turbine):
    """Tower, nacelle and rotor as (mass, centre, inertia)."""
    tower, nacelle, rotor = platform.tower, turbine.nacelle, turbine.rotor
    return [
        (tower.mass, (0.0, 0.0, tower.cm_height), tower.inertia),
        (nacelle.mass, (nacelle.cm_downwind, 0.0, nacelle.cm_height), nacelle.inertia),
        (
            rotor.mass,
            (-rotor.overhang, 0.0, rotor.hub_height),
            (rotor.inertia, rotor.inertia_diameter, rotor.inertia_diameter),
        ),
    ]


def build_rigid_body(platform, turbine, platform_held=False, rotor_held=False, plane=None):
    """RigidBody part: Eq. (10) from the four rigid bodies. plane: True holds sway, roll and yaw at zero."""
    ballast = platform.ballast
    matrix = assemble(
        [(ballast.mass, (0.0, 0.0, -ballast.cm_depth), ballast.inertia), *_upper_bodies(platform, turbine)]
    )
    drivetrain = build_drivetrain(turbine)
    return RigidBody(
        np.ascontiguousarray(matrix),
        float(matrix[0, 0]),
        float(matrix[1, 5]),
        float(matrix[0, 4]),
        float(platform.environment.gravity),
        drivetrain.coupling,
        drivetrain.inertia_row,
        platform_held,
        rotor_held,
        plane,
    )


def build_layout(platform, turbine):
    """Layout part: points and masses that outputs need."""
    rotor = turbine.rotor
    return Layout(
        np.array([-rotor.overhang, 0.0, rotor.hub_height]),
        np.array([0.0, 0.0, platform.tower.top_height]),
        float(platform.tower.base_height),
        float(rotor.mass),
        float(rotor.inertia),
        np.ascontiguousarray(assemble(_upper_bodies(platform, turbine))),
        float(turbine.drivetrain.gear_ratio),
        float(turbine.drivetrain.generator_efficiency),
        int(rotor.blades),
        np.linspace(rotor.hub_radius, rotor.tip_radius, 2 * SPAN_POINTS + 1)[1::2].copy(),
    )
