"""Linearises a scene about an operating point by central differences of the nonlinear plant."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment

from fowt_env.analysis.blade_coordinates import blade_waves
from fowt_env.analysis.linear_plant import (
    CYCLIC,
    MEASURED,
    RECORDED,
    TOWER,
    TWIST_STATES,
    WAKE,
    Plant,
    bending_names,
    cyclic_names,
    multiblade_point,
    plant_states,
)
from fowt_env.analysis.statics import central_difference, named_periods, rotation_of
from fowt_env.analysis.trim import trim, without_fluctuations
from fowt_env.analysis.wave_excitation import fit_wave_filter, wave_force
from fowt_env.descriptions.blade_structure import SHAPES
from fowt_env.descriptions.checks import check_number, is_number, short
from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.errors import InputError, unknown
from fowt_env.plant.channels import FIXED_CHANNELS
from fowt_env.plant.measurement import MEASURED as FIELDS
from fowt_env.plant.measurement import Measure, Measurement
from fowt_env.plant.state import MOTIONS, State, pose_of
from fowt_env.scene.actuators import linear_actuator
from fowt_env.scene.radiation_fit import linear_memory
from fowt_env.scene.scene import check_scene

VELOCITIES = ("vx", "vy", "vz", "wx", "wy", "wz")
INPUTS = ("generator_torque", "blade_pitch_command", "wind_speed")
INPUT_STEPS = np.array([1.0, 1e-5, 1e-3])
FREQUENCY_ROUNDS = 4  # iterations of a period and the added mass at that period
# internal blocks that linearize supports; the filtered position has no effect in flat water
LINEAR = ("radiation", "filtered position", "wake")
LEAST_LAG = 0.05  # s, of the blade pitch of a drive without lag: a step of the plant, no rate, sets its state
DRIVE = ("blade_pitch", "pitch_rate")  # states of a pitch drive with inertia
MEMORY = "radiation_"  # prefix of the states of radiation memory
FORCES = ("fx", "fy", "fz", "mx", "my", "mz")  # on the hull, body components about the body origin
FORCE_STEPS = np.array([1e2, 1e2, 1e2, 1e4, 1e4, 1e4])  # N, N m


# state: field of a Measurement; for velocities in body axes the rate of the position
MEASURED_AS = dict(zip(VELOCITIES, (f"{name}_rate" for name in MOTIONS), strict=True)) | {
    name: name for name in (*MOTIONS, "rotor_speed", "blade_pitch")
}
MEASURED_AS["generator_torque_in_force"] = "generator_torque"
COLUMNS = {  # state: column of the output of simulate
    "surge": "PtfmSurge", "sway": "PtfmSway", "heave": "PtfmHeave",
    "roll": "PtfmRoll", "platform_pitch": "PtfmPitch", "yaw": "PtfmYaw",
    **dict(zip(VELOCITIES, (f"Ptfm{kind}V{axis}i" for kind in "TR" for axis in "xyz"), strict=True)),
    "rotor_speed": "RotSpeed", "blade_pitch": "BldPitch1", "generator_torque_in_force": "GenTq",
}  # fmt: skip
BENDING = tuple(f"{part}{name}" for name in SHAPES for part in ("", *CYCLIC))  # of blades
STRUCTURAL = (*TOWER, *BENDING, TWIST_STATES[0])  # deflections of the structure
UNITS = {  # of states, inputs and outputs, SI
    **{field: measured.unit for field, measured in FIELDS.items()},
    **{name: FIELDS[field].unit for name, field in MEASURED_AS.items()},
    "pitch_rate": "rad/s", "blade_pitch_command": "rad", "power": "W", "rotor_thrust": "N",
    "tower_base_moment": "N m",
    **{name: "m" for name in TOWER}, **{f"{name}_rate": "m/s" for name in TOWER},
    **{name: "m" for name in BENDING}, **{f"{name}_rate": "m/s" for name in BENDING},
    **dict(zip(TWIST_STATES, ("rad", "rad/s"), strict=True)),
}  # fmt: skip


def sampled(a, b, dt):
    """Return (exp(A dt), integral of exp(A s) ds B) for inputs held over dt."""
    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = a, b
    both = expm(block * dt)
    return both[:n, :n], both[:n, n:]


def _state_space(matrices, states, inputs, outputs, name, *dt):
    """Return a control.StateSpace. Raises: InputError naming the extra to install."""
    try:
        from control import ss
    except ImportError as error:
        missing = f'to_statespace needs python-control ({error}): pip install "fowt-env[design]"'
        raise InputError(missing) from error
    return ss(*matrices, *dt, states=list(states), inputs=list(inputs), outputs=list(outputs), name=name)


@dataclass(frozen=True)
class DiscreteModel:
    """Holds a LinearModel sampled by zero-order hold over dt (s): x[k+1] = A x[k] + B u[k], y = C x + D u.

    States, names and units are those of the LinearModel, at the instants k dt.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dt: float
    states: tuple
    inputs: tuple
    outputs: tuple

    def to_statespace(self):
        """Return a control.StateSpace in discrete time. Raises: InputError naming the extra to install."""
        matrices, names = (self.A, self.B, self.C, self.D), (self.states, self.inputs, self.outputs)
        return _state_space(matrices, *names, "fowt_sampled", self.dt)


@dataclass(frozen=True)
class LinearModel:
    """Holds the linear model dx/dt = A dx + B du + E df, dy = C dx + D du + F df at an operating point (SI).

    The model is azimuth-averaged. A (m, m), B (m, 3), C (n, m), D (n, 3) with the names in states, inputs and
    outputs; E (m, 6) and F (n, 6) apply to further forces on the hull (FORCES). point is the OperatingPoint.
    The first 14 states are plant.state.STATES, followed by the states that the plant has of: dynamic inflow
    (wake_1 ...), deflections of a flexible tower (TOWER) and their rates (tower_fore_aft_rate ...),
    deflections of bending blades, mean of the blades (flap_1 ...), and their rates, TWIST_STATES of a shaft,
    ACTUATOR_STATES, cosine and sine components of the blades' states (tilt_flap_1, yaw_flap_1 ...:
    blade_coordinates.py), and radiation memory (radiation_1 ...).

    All variables are deviations from the operating point, given by `equilibrium` and `equilibrium_inputs`;
    state() computes the states from measurements. Velocities (vx to wz) are those of the body origin in body
    axes; MEASURED_AS maps each state to its field of a Measurement.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    E: np.ndarray
    F: np.ndarray
    states: tuple
    inputs: tuple
    outputs: tuple
    point: object
    cm_height: float  # of the whole turbine, body z, m
    arm: float  # m, half the draft: weight of angles relative to translations when modes are named
    scene: object = field(repr=False)

    def index(self, name):
        """Return the row of a state. Raises: InputError for an unknown name."""
        if name not in self.states:
            for state, field in MEASURED_AS.items():
                if field == name and state in self.states:
                    raise InputError(f"{name!r} is a field of Measurement: its state is {state!r}")
            raise unknown("state", name, self.states)
        return self.states.index(name)

    def output_index(self, name):
        """Return the row of an output. Raises: InputError for an unknown name."""
        if name not in self.outputs:
            raise unknown("output", name, self.outputs)
        return self.outputs.index(name)

    def __repr__(self):
        """Return the size and the operating point as a text, without the matrices."""
        size = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"LinearModel({size}, at {self.point!r})"

    @property
    def x0(self):
        """Return the states (m,) at the operating point."""
        names, indices, _ = plant_states(self.scene)
        mean, cyclic = multiblade_point(self.scene, self.point.state)
        values = {name: mean[each[0]] for name, each in zip(names, indices, strict=True)}
        values |= dict(zip(cyclic_names(cyclic), np.ravel(list(cyclic.values())), strict=True))
        return np.array([values.get(name, 0.0) for name in self.states])

    @property
    def equilibrium(self):
        """Return a pandas.Series (m,) of the states at the operating point, by name; units: see `units`."""
        return pd.Series(self.x0, index=list(self.states), name="equilibrium")

    @property
    def equilibrium_inputs(self):
        """Return a pandas.Series (3,) of the inputs at the operating point, by name; NaN for no wind."""
        torque, blade_pitch = self.point.command[:2]
        wind = np.nan if self.point.wind_speed is None else self.point.wind_speed
        return pd.Series([torque, blade_pitch, wind], index=list(self.inputs), name="equilibrium")

    @property
    def units(self):
        """Return {name: unit} of the states, inputs and outputs, SI; "" for states of memory and wake."""
        units = UNITS | {name: "N" for name in self.outputs if name.startswith("fairlead_tension_")}
        return {name: units.get(name, "") for name in (*self.states, *self.inputs, *self.outputs)}

    @property
    def fields(self):
        """Return the fields of a Measurement that state() reads, for a controller's `information`."""
        hidden = [name for name in self.states if name not in MEASURED_AS]
        if hidden:
            raise InputError(
                f"state: {', '.join(hidden[:4])}{' ...' if len(hidden) > 4 else ''}: are not measured; use"
                " a model without these states (fowt_env.analysis.reduced_model.residualised) or an estimator"
            )
        return tuple(MEASURED_AS[name] for name in self.states)

    @cached_property
    def _from_measurement(self):
        """Return (indices in a Measurement, (m, m) matrix, (m,) equilibrium) for state()."""
        indices = [int(Measure[field.upper()]) for field in self.fields]
        return indices, self._turning(euler=True), self.x0

    @cached_property
    def _from_frame(self):
        """Return (columns of a run's DataFrame, (m, m) matrix times the factors to SI, (m,) equilibrium)."""
        by_name = {channel.name: channel for channel in FIXED_CHANNELS}
        channels = [by_name[COLUMNS[name]] for name, _ in zip(self.states, self.fields, strict=True)]
        columns = [channel.column for channel in channels]
        return columns, self._turning(euler=False) / [channel.scale for channel in channels], self.x0

    def _turning(self, euler):
        """Return the (m, m) matrix from measurements to states: velocities into body axes at the trim.

        euler: angular velocities are rates of the Euler angles, else components in inertial axes.
        """
        turn = np.eye(len(self.states))
        body = rotation_of(pose_of(self.point.state)).T
        first, roll, pitch = self.index("vx"), *self.point.state[[State.ROLL, State.PLATFORM_PITCH]]
        turn[first : first + 3, first : first + 3] = body
        if euler:
            body = [
                [1.0, 0.0, -np.sin(pitch)],
                [0.0, np.cos(roll), np.sin(roll) * np.cos(pitch)],
                [0.0, -np.sin(roll), np.cos(roll) * np.cos(pitch)],
            ]
        turn[first + 3 : first + 6, first + 3 : first + 6] = body
        return turn

    def state(self, measured):
        """Return the deviation (m,) of the states from the operating point, computed from measurements.

        measured: a Measurement (a controller has to declare `fields`), or a row of the DataFrame that
        simulate returns, as a mapping of columns; a whole DataFrame gives (rows, m).
        Velocities are rotated into body axes at the operating point's attitude, exact to first order.
        Raises: InputError if the model has states that are not measured, or a column is missing.
        """
        if isinstance(measured, Measurement):
            indices, turn, rest = self._from_measurement
            return turn @ np.array([measured[index] for index in indices]) - rest
        columns, turn, rest = self._from_frame
        if not isinstance(measured, Mapping) and not hasattr(measured, "loc"):
            raise InputError(
                f"state: {type(measured).__name__}: must be a Measurement, or a row or all of a run"
            )
        try:
            values = [np.asarray(measured[column], dtype=float) for column in columns]
        except KeyError as error:
            raise InputError(f"state: the row has no column {error}") from None
        return (turn @ np.array(values)).T - rest

    def discretize(self, dt):
        """Return the DiscreteModel for inputs held over dt (s), by the matrix exponential (zero-order hold).

        Raises: InputError unless dt is positive.
        """
        if not is_number(dt) or not dt > 0.0:
            raise InputError(f"dt = {dt!r}: must be a positive number of seconds")
        a, b = sampled(self.A, self.B, float(dt))
        return DiscreteModel(a, b, self.C, self.D, float(dt), self.states, self.inputs, self.outputs)

    @property
    def pitch_rests(self):
        """Return whether the blade pitch is at a limit: below rated, where no controller moves the blades."""
        drive, pitch = self.scene.turbine.pitch_drive, self.point.state[State.BLADE_PITCH]
        return not drive.minimum + 1e-6 < pitch < drive.maximum - 1e-6

    def modes(self):
        """Return the modes [Mode] of the plant without control, slowest first."""
        return modes(self.A, self.states, self.cm_height, self.arm)

    @cached_property
    def wave_filter(self):
        """Return the WaveFilter, the causal model of the wave force that to_statespace() uses."""
        return fit_wave_filter(self.scene, self.point.state)

    def response(self, omega, inputs=("generator_torque", "blade_pitch_command", "wind_speed")):
        """Return the complex frequency response (n, outputs, inputs) at omega (n,) rad/s, exact for waves.

        inputs: names of inputs or "wave_elevation", the elevation at the hull's mean position.
        """
        omega = np.atleast_1d(np.asarray(omega, dtype=float))
        every = (*self.inputs, "wave_elevation")
        columns = [every.index(name) for name in chosen("input", inputs, every)]
        force = np.zeros((omega.size, 6))
        if "wave_elevation" in inputs:
            force = wave_force(self.scene, self.point.state, omega)
        result = np.empty((omega.size, len(self.outputs), len(columns)), dtype=complex)
        for i, w in enumerate(omega):
            b, d = np.c_[self.B, self.E @ force[i]], np.c_[self.D, self.F @ force[i]]
            left = 1j * w * np.eye(len(self.states)) - self.A
            for k, j in enumerate(columns):
                result[i, :, k] = self.C @ np.linalg.solve(left, b[:, j]) + d[:, j]
        return result

    def to_statespace(self, waves=None, inputs=None, outputs=None, name=None):
        """Return a control.StateSpace with named states, inputs and outputs (SI).

        waves: whether to include the wave force; None: if the scene has a sea. The last input then is
        wave_elevation, the elevation at the hull's mean position wave_filter.lead seconds ahead, because the
        wave force at depth is not a causal function of the elevation. The states wave_1 ... are those of the
        filter, whose errors are listed by band in wave_filter.errors; these states are not controllable, so
        design on the model without waves.
        inputs, outputs: names of those to keep, each one or several; None: all. Indexing a StateSpace of
        python-control gives the same system, but plots then have the title "fowt$indexed".
        name: of the system, in titles of plots; None: "fowt", or "INPUTS to OUTPUTS" for a subsystem.
        Raises: InputError for unknown names, or naming the extra to install.
        """
        if waves is None:
            waves = sea_state_of(self.scene.sea).height > 0.0
        a, b, c, d, states = self._with_waves() if waves else (self.A, self.B, self.C, self.D, self.states)
        every = (*self.inputs, "wave_elevation") if waves else self.inputs
        into, out = chosen("input", inputs, every), chosen("output", outputs, self.outputs)
        if name is None:
            whole = inputs is None and outputs is None
            name = "fowt" if whole else f"{', '.join(into)} to {', '.join(out)}"
        columns, rows = [every.index(i) for i in into], [self.outputs.index(o) for o in out]
        return _state_space((a, b[:, columns], c[rows], d[np.ix_(rows, columns)]), states, into, out, name)

    def _with_waves(self):
        """Return (A, B, C, D, states) with the wave filter's states and the elevation as last input."""
        waves = self.wave_filter
        n, m = len(self.states), waves.B.size
        a = np.zeros((n + m, n + m))
        a[:n, :n], a[:n, n:], a[n:, n:] = self.A, self.E @ waves.C, waves.A
        b = np.zeros((n + m, len(self.inputs) + 1))
        b[:n, :-1], b[n:, -1] = self.B, waves.B
        c = np.hstack([self.C, self.F @ waves.C])
        d = np.hstack([self.D, np.zeros((len(self.outputs), 1))])
        return a, b, c, d, (*self.states, *(f"wave_{i + 1}" for i in range(m)))


def chosen(kind, names, known):
    """Return a tuple of names from one name, several, or None (all known). Raises: InputError if unknown."""
    if names is None:
        return tuple(known)
    names = (names,) if isinstance(names, str) else tuple(names)
    for name in names:
        if name not in known:
            raise unknown(kind, name, known)
    return names


class Mode(NamedTuple):
    """Holds name, period and damping of one oscillating mode."""

    name: str  # the state with the largest participation
    period: float  # s
    damping_ratio: float
    frequency: float  # rad/s


def modes(a, names, cm_height, arm):
    """Return the modes [Mode] of a system matrix a (n, n) with these state names, slowest first.

    A mode of the structure, by participation factors, is named by the deflection with the largest ones, each
    name once: a wave of blade bending around the rotor is regressive or progressive (flap_1_regressive); if
    all blades bend alike, it has the name of the bending mode. Another mode is named by its largest motion:
    translations of the centre of mass (at the water line a platform-pitch mode moves more in surge than in
    pitch), angles times arm (m), and rotor speed times arm/12 s.
    Modes dominated by states of radiation memory, dynamic inflow, a pitch drive with inertia or cyclic blade
    pitch are omitted.
    """
    values, vectors = np.linalg.eig(a)
    drive = DRIVE if "pitch_rate" in names else ()
    cyclic = tuple(f"{part}pitch" for part in CYCLIC)
    internal = [name.startswith((MEMORY, WAKE, *cyclic)) or name in drive for name in names]
    bent = any(name in STRUCTURAL for name in names)
    factors = np.zeros((len(names), len(values)))
    if any(internal) or bent:
        factors = np.abs(vectors * np.linalg.inv(vectors).T)
        factors /= factors.sum(axis=0)
    kept = [k for k, value in enumerate(values) if value.imag > 1e-6 and factors[internal, k].sum() <= 0.5]
    of_structure = _structural_modes(names, vectors[:, kept], factors[:, kept]) if bent else {}
    result = []
    for k, (value, vector) in enumerate(zip(values[kept], vectors[:, kept].T, strict=True)):
        part = dict(zip(names, vector, strict=True))
        participation = {
            "surge": abs(part["surge"] + cm_height * part["platform_pitch"]),
            "sway": abs(part["sway"] - cm_height * part["roll"]),
            "heave": abs(part["heave"]),
            **{angle: arm * abs(part[angle]) for angle in MOTIONS[3:]},
            "rotor_speed": arm / 12.0 * abs(part["rotor_speed"]),
        }
        name = of_structure.get(k, max(participation, key=participation.get))
        size = abs(value)
        result.append(Mode(name, float(2.0 * np.pi / value.imag), float(-value.real / size), float(size)))
    return sorted(result, key=lambda mode: -mode.period)


def _structural_modes(names, vectors, factors):
    """Return {column: name} of the modes dominated by tower, blades and shaft (modes)."""
    shares = {}
    for row, name in enumerate(names):
        deflection, rate = name.removesuffix("_rate"), name.endswith("_rate")
        if deflection not in STRUCTURAL:
            continue
        if not deflection.startswith(CYCLIC):
            shares[deflection] = shares.get(deflection, 0.0) + factors[row]
            continue
        mode = deflection.removeprefix(CYCLIC[0]).removeprefix(CYCLIC[1])
        tilt, yaw = (vectors[names.index(f"{part}{mode}{'_rate' * rate}")] for part in CYCLIC)
        waves = {way: np.abs(wave) ** 2 for way, wave in blade_waves(tilt, yaw).items()}
        for way, wave in waves.items():
            label = f"{mode}_{way}"
            shares[label] = shares.get(label, 0.0) + factors[row] * wave / sum(waves.values())
    labels, table = list(shares), np.array(list(shares.values()))
    columns = np.flatnonzero(table.sum(axis=0) > 0.5)
    rows, chosen_columns = linear_sum_assignment(-table[:, columns])
    return {int(columns[k]): labels[i] for i, k in zip(rows, chosen_columns, strict=True)}


def check_linear(scene, known=LINEAR):
    """Raise InputError for a scene with internal states that are not linearised."""
    internal = [block.name for block in scene.blocks if block.steady == "settled" and block.name not in known]
    if internal:
        switches = {"wake": "dynamic_inflow", "airfoil": "unsteady_airfoils"}
        hint = "".join(f" ({option}=False)" for name, option in switches.items() if name in internal)
        raise InputError(
            f"linearize: the states of {', '.join(internal)} cannot be linearised: build the scene without"
            f" them{hint}"
        )


def steady_parts(scene, point):
    """Return {path: part} to replace for linearisation: platform fixed as in point, linear actuator."""
    body = scene.model.rigid_body._replace(platform_fixed=point.platform == "fixed")
    return {"rigid_body": body, "actuator": linear_actuator(scene.model.actuator)}


def linearize(scene, operating_point=None, *, wind=None):
    """Return the LinearModel of a scene about an operating point (default: its floating trim).

    wind: mean hub wind of the trim (m/s) instead of the scene's wind; a controller's `prepare` can linearise
    over the wind speed by this argument.

    The wind input changes the hub wind together with its shear; waves are flat, and wave_force adds their
    first-order force. Drag has no linear part at rest in still water, so viscous damping is absent there.
    Radiation memory is included exactly, for the convolution by the fit of the state-space option. Dynamic
    inflow has four states per annulus: wake_1 to 4 are those of the innermost station (aero/wake.py).
    Deadband and friction of a pitch drive are omitted; one without lag has LEAST_LAG. blade_pitch is the
    collective pitch. Bending blades are in multi-blade coordinates about their periodic state; variations at
    three per turn are omitted.

    Raises: InputError for a scene with other internal states, for a wind in a scene without aerodynamics, and
    for a wind together with an operating point.
    """
    check_scene(scene)
    check_linear(scene)
    if wind is not None:
        if operating_point is not None:
            raise InputError(f"wind = {short(wind)}: an operating point has a wind already; give one only")
        scene = scene.with_weather(wind=check_number("wind", wind, 0.0))
    point = trim(scene) if operating_point is None else operating_point
    return with_pitch_lag(differentiated(scene, point, bending_names(scene)))


def with_pitch_lag(model):
    """Return the LinearModel with a lag of LEAST_LAG in the blade pitch; unchanged if its drive has a lag."""
    if model.scene.turbine.pitch_drive.lag > 0.0:
        return model
    a, b = model.A.copy(), model.B.copy()
    for column, name in enumerate(model.inputs):
        if name.endswith("pitch_command"):  # collective, or a component of the cyclic pitch
            row = model.index(name.removesuffix("_command"))
            a[row, row], b[row, column] = -1.0 / LEAST_LAG, 1.0 / LEAST_LAG
    return replace(model, A=a, B=b)


def differentiated(scene, point, bladed, inputs=(), outputs=()):
    """Return the LinearModel of a scene at an OperatingPoint by central differences.

    bladed: states of single blades that have cyclic components; inputs: names of the cosine and sine
    components of the pitch command, or none; outputs: MOMENTS or none.
    """
    parts = steady_parts(scene, point)
    (x, bent), u, force = multiblade_point(scene, point.state), point.command.copy(), np.zeros(6)
    cyclic = np.array([*(bent.get(name, np.zeros(2)) for name in bladed), np.zeros(2)])

    def plant_at(speed):
        return Plant(without_fluctuations(scene, speed).with_model(parts), bladed, outputs)

    plant = plant_at(point.wind_speed)
    names, indices, steps = plant_states(scene)
    cyclic_steps = [steps[names.index(name)] for name in bladed]

    def slope(array, index, step):
        return central_difference(lambda: plant(x, u, force, cyclic), array, index, step)

    def cyclic_slopes(rows, row_steps):
        return [
            slope(cyclic, (k, part), step)
            for k, step in zip(rows, row_steps, strict=True)
            for part in range(2)
        ]

    of_states = [slope(x, each, step) for each, step in zip(indices, steps, strict=True)]
    of_states += cyclic_slopes(range(len(bladed)), cyclic_steps)
    of_inputs = [slope(u, 0, INPUT_STEPS[0]), slope(u, list(range(1, scene.n_commands)), INPUT_STEPS[1])]
    of_inputs.append(wind_slope(lambda speed: plant_at(speed)(x, u, force, cyclic), point, of_inputs[0]))
    of_inputs += cyclic_slopes([len(bladed)], INPUT_STEPS[1:2]) if inputs else []
    of_forces = [slope(force, i, FORCE_STEPS[i]) for i in range(6)]
    states = (*names, *cyclic_names(bladed))
    return assembled(scene, point, (of_states, of_inputs, of_forces), states, inputs, outputs)


def wind_slope(evaluate, point, like):
    """Return the central difference of evaluate(wind speed) about an OperatingPoint; zeros without wind."""
    if point.wind_speed is None:
        return np.zeros_like(like)
    up, down = (evaluate(point.wind_speed + sign * INPUT_STEPS[2]) for sign in (1.0, -1.0))
    return (up - down) / (2.0 * INPUT_STEPS[2])


def assembled(scene, point, columns, states, inputs=(), outputs=()):
    """Return the LinearModel of derivative columns by states, inputs and forces, with additional names."""
    of_states, of_inputs, of_forces = (np.array(group).T for group in columns)
    n, body = len(states), scene.model.rigid_body
    tensions = tuple(f"fairlead_tension_{i + 1}" for i in range(scene.n_lines))
    model = LinearModel(
        of_states[:n], of_inputs[:n], of_states[n:], of_inputs[n:], of_forces[:n], of_forces[n:],
        states, (*INPUTS, *inputs), (*MEASURED, *RECORDED, *tensions, *outputs),
        point, body.s_z / body.mass, 0.5 * scene.platform.draft, scene,
    )  # fmt: skip
    return with_memory(model, linear_memory(scene))


def with_memory(model, memory):
    """Return the LinearModel with the states of a scene.radiation_fit.LinearMemory; unchanged for None.

    The platform is at rest at the operating point, so velocities are rotated into inertial axes by the
    attitude alone.
    """
    if memory is None:
        return model
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = rotation_of(pose_of(model.point.state))
    m, n = memory.A.shape[0], len(model.states)
    speeds = [model.index(name) for name in VELOCITIES]
    force = -turn.T @ memory.C
    a = np.zeros((n + m, n + m))
    a[:n, :n], a[:n, n:], a[n:, n:] = model.A, model.E @ force, memory.A
    a[np.ix_(range(n, n + m), speeds)] = memory.B @ turn
    return replace(
        model,
        A=a,
        B=np.vstack([model.B, np.zeros((m, model.B.shape[1]))]),
        C=np.hstack([model.C, model.F @ force]),
        E=np.vstack([model.E, np.zeros((m, 6))]),
        states=(*model.states, *(f"{MEMORY}{k + 1}" for k in range(m))),
    )


def settled(model, names):
    """Return the LinearModel of the autonomous plant with the named states in equilibrium."""
    gone = [model.index(name) for name in names]
    kept = [i for i in range(len(model.states)) if i not in gone]
    follows = np.linalg.solve(model.A[np.ix_(gone, gone)], model.A[np.ix_(gone, kept)])
    a = model.A[np.ix_(kept, kept)] - model.A[np.ix_(kept, gone)] @ follows
    return replace(model, A=a, states=tuple(model.states[i] for i in kept))


def natural_periods(scene):
    """Return {motion: undamped natural period s} of the six motions about the trim, from stiffness and mass.

    Tower modes of a flexible tower follow, named by TOWER; blades bend and the shaft twists quasi-statically.
    A motion without restoring (no moorings) gets inf.
    Modes are named by their largest motion, angles weighted with half the draft. With radiation memory the
    added mass is taken at the natural frequency of the motion.
    """
    model = linearize(scene)
    periods = _periods(model, 0.0)
    rounds = FREQUENCY_ROUNDS if any(name.startswith(MEMORY) for name in model.states) else 0
    for motion in periods:
        for _ in range(rounds):
            if np.isfinite(periods[motion]):
                periods[motion] = _periods(model, 2.0 * np.pi / periods[motion])[motion]
    return periods


def _periods(model, omega):
    """Return {motion: undamped natural period s} with the added mass of the memory at a frequency, rad/s."""
    quick = [name for name in model.states if name.removesuffix("_rate") in STRUCTURAL[len(TOWER) :]]
    model = settled(model, quick)
    deflections = [name for name in TOWER if name in model.states]
    names = (*MOTIONS, *deflections)
    n = len(names)
    positions = [model.index(name) for name in names]
    speeds = [model.index(name) for name in (*VELOCITIES, *(f"{name}_rate" for name in deflections))]
    memory = [i for i, name in enumerate(model.states) if name.startswith(MEMORY)]
    # velocities are body components, so positions follow from the kinematics K: q' = K v, v' = S q
    kinematics, stiffness = model.A[np.ix_(positions, speeds)], model.A[np.ix_(speeds, positions)]
    if memory:
        # v' = S q + N z, z' = Z z + L v: the part of N z in phase with v' = i w v acts as added mass
        into, out = model.A[np.ix_(memory, speeds)], model.A[np.ix_(speeds, memory)]
        within = model.A[np.ix_(memory, memory)]
        square = within @ within + omega**2 * np.eye(within.shape[0])
        stiffness = np.linalg.solve(np.eye(n) + out @ np.linalg.solve(square, into), stiffness)
    values, vectors = np.linalg.eig(kinematics @ stiffness)
    scale = np.array([model.arm if name in MOTIONS[3:] else 1.0 for name in names])
    return named_periods(values, np.abs(vectors) * scale[:, None], names)
