"""Defines Scene: a turbine on its platform in given weather, ready for time stepping."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from fowt_env.descriptions.checks import check_whole_number, short
from fowt_env.descriptions.lidar import Lidar
from fowt_env.descriptions.platform import Platform
from fowt_env.descriptions.turbine import Turbine
from fowt_env.display import html_table
from fowt_env.errors import InputError
from fowt_env.plant.aero.bent_blade import blade_entries
from fowt_env.plant.channels import Channel, channels, put_hub_wind, scales
from fowt_env.plant.compile.handle import Handle
from fowt_env.plant.elastic.structure import rotor_scratch
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.hydro.excitation import excitation_scratch, position_states
from fowt_env.plant.hydro.member_series import N_WATER
from fowt_env.plant.hydro.members import N_NODE
from fowt_env.plant.hydro.radiation import memory_data, memory_states
from fowt_env.plant.hydro.wave_bands import band_scratch
from fowt_env.plant.integrators import rotor_samples
from fowt_env.plant.line_dynamics import line_states, line_work
from fowt_env.plant.measurement import N_BLADE_MEASUREMENTS, N_MEASUREMENTS
from fowt_env.plant.model import N_CACHE, Data
from fowt_env.plant.rotor_substeps import N_SAMPLE
from fowt_env.plant.slow_loads import N_SLOW
from fowt_env.plant.state import (
    BLADES,
    N_BLADE_LOAD,
    N_COMMANDS,
    N_INDIVIDUAL_COMMANDS,
    Block,
    State,
    state_blocks,
)
from fowt_env.plant.user_loads import user_data_size
from fowt_env.scene.actuators import drive_states
from fowt_env.scene.blade_beam import blade_states, kept_states
from fowt_env.scene.options import FIDELITIES, LEVEL_PARTS, OPTIONS, least_lag
from fowt_env.scene.parts import airfoil_states, hydro_in_waves, step_of, wake_states
from fowt_env.scene.radiation_fit import memory_for_step
from fowt_env.scene.tower import tower_states
from fowt_env.scene.user_loads import Load, first_nonfinite_load
from fowt_env.scene.weather import Sea, Wind, build_weather
from fowt_env.weather.wind import hub_series
from fowt_env.weather.wind_field import WindBox, hub_wind

UNCHANGED: Any = object()  # default of arguments for which None has a meaning


@dataclass(frozen=True, eq=False)
class Scene:
    """Holds a turbine on its platform in given weather, ready for time stepping.

    Kernels read `model`; the other fields are its origin. A scene is never modified: state vector and scratch
    arrays belong to the run.
    """

    model: Any  # a plant.model.Model; its parts have many types
    platform: Platform
    turbine: Turbine
    wind: Any  # as specified
    sea: Any
    seed: int
    rotor: str
    options: dict
    wind_speed: float | None  # mean hub wind for a trim; None without aerodynamics
    loads: tuple[Load, ...] = ()  # user-defined loads
    label: str = ""  # name or path of the platform, as specified
    plant: object = field(default_factory=object, repr=False)  # the same for the same model but for weather
    lidar: Lidar | None = None  # on the nacelle; set in the scene for a controller's prepare() alone
    steps: dict = field(default_factory=dict, init=False, repr=False)  # {time step, s: Scene of with_step}

    @property
    def n_lines(self) -> int:
        return 0 if self.model.mooring is None else self.model.mooring.length.shape[0]

    @property
    def load_names(self) -> tuple[str, ...]:
        return tuple(load.name for load in self.loads)

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """Return the blocks of this scene's state vector, in order."""
        internal = {"wake": wake_states(self.model.aero), "airfoil": airfoil_states(self.model.aero)}
        internal |= {f"load {load.name}": load.states for load in self.loads}
        bending = tower_states(self.model.tower) // 2
        internal |= {"tower_deflection": bending, "tower_velocity": bending}
        flapping = blade_states(self.model.blades) // 2
        internal |= {"blade_deflection": flapping, "blade_velocity": flapping}
        twisting = 0 if self.model.shaft is None else 1
        internal |= {"shaft_twist": twisting, "shaft_twist_rate": twisting}
        internal |= {"other_blade_pitches": 0 if self.model.pitches is None else BLADES - 1}
        internal |= drive_states(self.model.actuator, self.model.pitches)
        internal |= {"generator_torque": 0 if self.model.converter is None else 1}
        internal |= {"filtered position": position_states(self.model.hydro)}
        internal |= {"radiation": memory_states(self.model.hydro)}
        return state_blocks(internal | {"lines": line_states(self.model.mooring)})

    @property
    def n_state(self) -> int:
        return self.blocks[-1].offset + self.blocks[-1].size

    @property
    def n_commands(self) -> int:
        """Return the number of commands: generator torque and collective or individual blade pitches."""
        return N_COMMANDS if self.model.pitches is None else N_INDIVIDUAL_COMMANDS

    @property
    def pitch_states(self) -> tuple[int, ...]:
        """Return the state indices of the collective blade pitch, or of the pitch of each blade."""
        pitches = self.model.pitches
        others = () if pitches is None else range(pitches.first, pitches.first + BLADES - 1)
        return (int(State.BLADE_PITCH), *others)

    @property
    def n_measurements(self) -> int:
        """Return the number of fields of Measurement and, with individual pitch, of BladeMeasurement."""
        return N_MEASUREMENTS + (0 if self.model.pitches is None else N_BLADE_MEASUREMENTS)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Return the output channels of this scene, in row order."""
        return channels(self.n_lines, self.load_names, self.channel_groups)

    @property
    def channel_groups(self) -> tuple[str, ...]:
        """Return the names of the GROUPS of channels of this scene, in addition to the fixed channels."""
        model = self.model
        parts = {"tower": model.tower, "shaft": model.shaft, "bending": model.blades, "blades": model.pitches}
        return tuple(name for name, part in parts.items() if part is not None)

    def values(self, rows: np.ndarray, overwrite: bool = False) -> np.ndarray:
        """Return output rows (k, n_channels), written in SI by kernels, in the units of the channels.

        If the plant's wind is a rotor average, Wind1VelX to Z are replaced by the wind at the hub.
        overwrite: convert in place; copying a long run takes up to a tenth of its run time.
        """
        rows = rows if overwrite else rows.copy()
        if self._hub_wind is not None:
            put_hub_wind(rows, self._hub_wind, self.model.aero.wind.period)
        rows *= scales(self.n_lines, self.load_names, self.channel_groups)
        return rows

    @cached_property
    def _hub_wind(self):
        """Return (time, (n, 3)) of the wind at the hub if the model's wind is a rotor average, else None."""
        rotor = self.turbine.rotor
        if isinstance(self.wind, WindBox):
            return hub_wind(self.wind, rotor.hub_height) if self.model.aero.field is None else None
        rotor_size = {"reference_height": rotor.hub_height, "rotor_diameter": 2.0 * rotor.tip_radius}
        series = hub_series(self.wind, **rotor_size, seed=self.seed, duration=self.options["duration"])
        if series is not None and self.options["planar"]:
            series[1][:, 1] = 0.0
        return series

    @property
    def weather_kind(self) -> tuple[bool, bool, bool, str]:
        """Return the properties that with_weather keeps: (aerodynamics, wind box, waves, class of strips)."""
        aero, hydro = self.model.aero, self.model.hydro
        field = aero is not None and aero.field is not None
        waves = hydro is not None and hydro.waves is not None
        return aero is not None, field, waves, "" if hydro is None else type(hydro.strips).__name__

    def data(self) -> Data:
        """Return new scratch arrays for one plant of this scene."""
        model, hydro, bending = self.model, self.model.hydro, tower_states(self.model.tower) // 2
        strips = None if hydro is None else hydro.strips
        members = None if hydro is None else hydro.members
        most = max((load.states for load in self.loads), default=0)
        laid = 0 if members is None else members.scratch_nodes
        nodes = 0 if members is None else laid or len(members.nodes)
        return Data(
            lines=np.zeros((self.n_lines, 6)),
            flood=np.zeros((6, 6)),
            line_work=line_work(self.model.mooring),
            counters=np.zeros(N_COUNTERS),
            kinematics=np.zeros((7, 0 if strips is None else strips.shape.nodes)),
            bands=band_scratch(getattr(strips, "bands", None), getattr(strips, "quadrature", None)),
            excitation=excitation_scratch(hydro),
            member_nodes=np.zeros((laid, N_NODE)),
            member_water=np.zeros(N_WATER * nodes),
            added_mass=np.zeros((6, 6)),
            matrix=np.zeros((6 + bending, 6 + bending)),
            stages=np.zeros((5, self.n_state)),
            cache=np.zeros(N_CACHE),
            user=np.zeros(user_data_size(len(self.loads), most)),
            history=np.zeros((4, self.n_state)),
            elastic=np.zeros((4, kept_states(model.blades, model.shaft))),
            samples=np.zeros((4 * rotor_samples(self.model.integrator), N_SAMPLE)),
            radiation=memory_data(hydro),
            slow=np.zeros((4, 0 if self.model.blades is None else N_SLOW)),
            blades=np.zeros((0 if self.model.pitches is None else BLADES, self._n_blade_load)),
            rotor=rotor_scratch(model.structure, model.tower, model.blades, model.shaft, self.n_state),
        )

    @property
    def _n_blade_load(self):
        """Return the number of entries of Data.blades for each blade."""
        aero = self.model.aero
        if self.model.blades is None or aero is None:
            return N_BLADE_LOAD
        return N_BLADE_LOAD + blade_entries(aero.rotor.elements.modes)

    def handle(self, data: Data | None = None) -> Handle:
        """Return the model and data in the form that kernels take from Python."""
        return Handle(self.model, self.data() if data is None else data)

    def first_nonfinite_load(self, data: Data) -> str | None:
        """Return a text on the user-defined load that made a run of this data non-finite; None otherwise."""
        return first_nonfinite_load(self.loads, data.user)

    def with_weather(self, wind: Wind = UNCHANGED, sea: Sea = UNCHANGED, seed: int | None = None) -> "Scene":
        """Return the scene with another wind, sea or seed and a model of the same types: nothing is compiled.

        Omitted arguments are unchanged. sea None is still water; in a scene built with a sea, a wave of zero
        height, with the loads of a scene built in still water to rounding, at twice the run time.
        Raises: InputError, also if aerodynamics, a wind box or a sea would be added, or the first two removed
        (build a new scene instead).
        """
        wind = self.wind if wind is UNCHANGED else wind
        sea = self.sea if sea is UNCHANGED else sea
        seed = check_whole_number("seed", self.seed if seed is None else seed, 0)
        air, waves = build_weather(wind, sea, seed, self.platform, self.turbine, self.rotor, self.options)
        aero, hydro = self.model.aero, self.model.hydro
        if (air.series is None) != (aero is None):
            raise InputError(
                f"wind = {short(wind)}: a scene cannot gain or lose its aerodynamics; use build_scene"
            )
        if aero is not None and (air.field is None) != (aero.field is None):
            raise InputError(
                f"wind = {short(wind)}: a scene cannot gain or lose its box of full-field wind;"
                " use build_scene"
            )
        if waves is not None and hydro.waves is None:
            raise InputError(
                f"sea = {short(sea)}: a scene built in still water cannot gain a sea; build it with one"
                " (build_scene, or FowtEnv, with sea = ...), and sea = None is still water in it"
            )
        if hydro is not None and hydro.waves is not None:
            hydro = hydro_in_waves(hydro, waves, self.platform, self.options)
        if aero is not None:
            aero = aero._replace(wind=air.series, field=air.field)
        model = self.model._replace(aero=aero, hydro=hydro)
        weather = {"wind": air.spec, "sea": sea, "seed": seed, "wind_speed": air.speed}
        # trims depend on the profile of a box of wind
        plant = self.plant if air.field is None else object()
        return replace(self, model=model, plant=plant, **weather)

    @property
    def dt(self) -> float:
        """Return the default physics step (s) of the integrator; finer for fidelity, tower or lines."""
        model = self.model
        parts = model.tower, model.mooring, model.rigid_body, model.structure
        return step_of(self.options, *parts, self.turbine)

    def with_step(self, dt: float) -> "Scene":
        """Return this scene for the time step dt (s).

        A radiation convolution and unsteady airfoils hold for one step only, and lags of dynamic inflow are
        limited by the step. The same step gives the same scene and, in other weather, the same plant: further
        runs find its trim.
        """
        hydro, aero, parts = self.model.hydro, self.model.aero, {}
        memory = None if hydro is None else hydro.radiation
        adapted = memory_for_step(memory, self.platform.potential_flow, dt, self.options["planar"])
        if adapted is not memory:
            parts["hydro.radiation"] = adapted
        if wake_states(aero) and aero.rotor.wake.least != (
            least := least_lag(dt, self.options["integrator"])
        ):
            parts["aero.rotor.wake.least"] = least
        if airfoil_states(aero) and aero.rotor.elements.airfoils.dt != dt:
            parts["aero.rotor.elements.airfoils.dt"] = float(dt)
        if not parts:
            return self
        if dt not in self.steps:
            self.steps[dt] = replace(self.with_model(parts), plant=(self.plant, dt))
        return self.steps[dt]

    def with_model(self, parts: Mapping[str, Any] | None = None, **slots: Any) -> "Scene":
        """Return a copy with some parts of the model replaced (same types: no recompilation).

        parts: {path: part}, as {"hydro.damping": ...}; slots: those at the top, as rigid_body=...
        """
        model = self.model
        for path, part in {**(parts or {}), **slots}.items():
            model = _replaced(model, path.split("."), part)
        return replace(self, model=model, plant=object())

    def __repr__(self):
        return (
            f"Scene({self.platform.name!r}, wind={self.wind!r}, sea={self.sea!r}, seed={self.seed},"
            f" rotor={self.rotor!r})"
        )

    def _repr_html_(self):
        """Return the HTML for notebooks: the scene's parts and each option that is not the fidelity's."""
        rows = [
            ("platform", self.label or self.platform.name),
            ("turbine", f"{self.turbine.name}, rated {self.turbine.torque_law.rated_power / 1e6:.3g} MW"),
            ("water depth", f"{self.platform.environment.water_depth:g} m"),
            ("wind", "none" if self.wind is None else short(self.wind)),
            ("sea", "still water" if self.sea is None else short(self.sea)),
            ("seed", str(self.seed)),
            ("rotor model", self.rotor),
            ("physics step", f"{self.dt:g} s"),
            ("states", str(self.n_state)),
        ]
        default = {name: option.default for name, option in OPTIONS.items()}
        default |= {part: getattr(FIDELITIES[self.options["fidelity"]], part) for part in LEVEL_PARTS}
        rows += [(name, str(value)) for name, value in self.options.items() if value != default.get(name)]
        return html_table("Scene", (), rows)


def check_scene(scene: Any) -> None:
    """Raise InputError for anything but a Scene, such as the name of a platform."""
    if not isinstance(scene, Scene):
        raise InputError(
            f"scene = {short(scene)}: must be a Scene, a platform in its wind and sea:"
            " build_scene('oc3_hywind', wind='ntm:18:B', sea='jonswap:4:9')"
        )


def _replaced(part, path, value):
    """Return a part of a model with the value at a path of field names replaced."""
    name, *rest = path
    return part._replace(**{name: _replaced(getattr(part, name), rest, value) if rest else value})
