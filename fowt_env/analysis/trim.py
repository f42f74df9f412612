"""Computes the steady operating point of a scene, azimuth-averaged, in mean wind and still water."""

from collections.abc import Mapping
from math import cos, pi, sin

import numpy as np
from scipy.optimize import brentq

from fowt_env.analysis.blade_coordinates import TURN, CyclicMean, bending_states, placed
from fowt_env.analysis.equilibrium import check_equilibrium, evaluated, label, unbalanced
from fowt_env.analysis.statics import Evaluation, central_difference, mean_derivative, with_hanging_lines
from fowt_env.caches import Cache
from fowt_env.descriptions.channel_meanings import channel_meaning
from fowt_env.display import html_table
from fowt_env.errors import InputError, unknown
from fowt_env.plant.advance import output_row
from fowt_env.plant.aero.load import settled_wake
from fowt_env.plant.aero.unsteady_airfoil import STEADY
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.channels import to_units
from fowt_env.plant.compile.decorators import entry
from fowt_env.plant.compile.handle import data_of, model_of
from fowt_env.plant.drivetrain import build_torque_curve, generator_torque
from fowt_env.plant.line_dynamics import rest_lines
from fowt_env.plant.state import BLADES, Command, State, pose_of
from fowt_env.plant.tilt import rotor_pose
from fowt_env.scene.actuators import rest_actuators
from fowt_env.scene.channel_names import channel_name, channel_unit
from fowt_env.scene.parts import airfoil_states, still_hydro
from fowt_env.scene.scene import Scene, check_scene
from fowt_env.weather.wind import make_series
from fowt_env.weather.wind_field import steady_field

AZIMUTHS = 12  # samples over 120 degrees, the period of three blades
NEWTON_ROUNDS = 40
TOLERANCE = 1e-11  # m/s2 and rad/s2 of remaining acceleration
BENT = 1e-10  # m/s2, of the modes of blades, and rad/s2, of the twist of the shaft
OUTER_ROUNDS = 30
FEATHERED = 0.5 * pi
HALVINGS = 12
DIFFERENCE_STEPS = {  # of the differences, m, rad and rad/s
    **dict.fromkeys((0, 1, 2), 1e-3),
    **dict.fromkeys((3, 4, 5), 1e-5),
    int(State.ROTOR_SPEED): 1e-4,
    int(State.BLADE_PITCH): 1e-5,
}
DEFLECTION_STEP = 1e-3  # m, of the deflections of a flexible tower and of blades
TWIST_STEP = 1e-5  # rad, of the shaft
PLATFORM_MODES = ("floating", "fixed")
_TRIMS = Cache(1024)  # (plant, mean weather, platform mode) -> OperatingPoint


class OperatingPoint(Mapping):
    """Holds a steady state as a mapping of OpenFAST channels, e.g. op["RotThrust"] or op["RotThrust_[kN]"].

    Attributes: state (n_state,) and command (n_commands,): generator torque N m, blade pitch rad, both SI;
    wind_speed (m/s or None); platform ("floating" or "fixed").
    """

    def __init__(self, values, state, command, wind_speed, platform):
        self.data = dict(values)
        self.state, self.command = state, command
        self.wind_speed, self.platform = wind_speed, platform

    def __getitem__(self, name):
        key = channel_name(name)
        if key not in self.data:
            raise unknown("channel", name, self.data)
        return self.data[key]

    def get(self, name, default=None):
        return self.data.get(channel_name(name), default)

    def __contains__(self, name):
        return channel_name(name) in self.data

    def __iter__(self):
        return iter(self.data)

    def __len__(self):
        return len(self.data)

    def copy(self):
        """Return the same point with separate arrays."""
        return OperatingPoint(
            self.data, self.state.copy(), self.command.copy(), self.wind_speed, self.platform
        )

    def _repr_html_(self):
        """Return the HTML shown in a notebook: each channel with its unit and meaning."""
        wind = "without wind" if self.wind_speed is None else f"at {self.wind_speed:g} m/s"
        rows = [(name, value, channel_unit(name), channel_meaning(name)) for name, value in self.items()]
        title = f"Operating point {wind}, platform {self.platform}"
        return html_table(title, ("channel", "value", "unit", "meaning"), rows)

    def __repr__(self):
        shown = ("RotSpeed", "BldPitch1", "GenPwr", "RotThrust", "PtfmSurge", "PtfmPitch")
        text = ", ".join(f"{name} {self.data[name]:.4g}" for name in shown)
        return f"OperatingPoint({text}, platform={self.platform!r})"


def without_fluctuations(scene, wind_speed=None):
    """Return the scene in steady mean wind and flat water: same types, so no recompilation.

    Waves are removed entirely. A box of wind is replaced by its time mean, which keeps the box's profile.
    Airfoils are quasi-steady.
    """
    parts = {}
    aero, hydro = scene.model.aero, scene.model.hydro
    if hydro is not None and hydro.waves is not None:
        parts["hydro"] = still_hydro(hydro, scene.platform, scene.options)
    if aero is not None:
        speed = scene.wind_speed if wind_speed is None else wind_speed
        if aero.field is not None:
            factor = 1.0 if wind_speed is None else wind_speed / scene.wind_speed
            parts["aero.field"] = steady_field(aero.field, factor)
        if airfoil_states(aero):
            parts["aero.rotor.elements.airfoils.dt"] = STEADY
        parts["aero.wind"] = make_series(
            np.zeros(1),
            np.array([[speed, 0.0, 0.0, 0.0, 0.0]]),
            reference_height=aero.wind.reference_height,
            reference_length=aero.wind.reference_length,
            shear_exponent=aero.wind.shear_exponent,
        )
    return with_hanging_lines(scene.with_model(parts))


@entry
def settle_wake(handle, x, dx):
    """Set the wake states of x to their steady values for the other states; needs dynamic inflow."""
    aero = model_of(handle).aero
    pose, now, data = rotor_pose(pose_of(x), aero.tilt), wind_now(0.0, aero.wind), data_of(handle)
    settled_wake(
        0.0, pose, x, now, aero, aero.rotor, dx, data.counters, model_of(handle).pitches, data.blades
    )


SETTLING = 8  # Newton steps for a block of internal states; one is enough for linear states


class _Steady(Evaluation):
    """Evaluates residuals of a scene without fluctuations, and solves for the steady state."""

    def __init__(self, scene):
        super().__init__(scene)
        self.scene, self.x = scene, np.zeros(scene.n_state)
        self.curve = build_torque_curve(self.scene.turbine.torque_law)
        self.start = None  # equilibrium.Evaluated of the undisplaced platform
        self.slope = None  # last Jacobian of the motions
        self.bent = bending_states(scene)  # x has the mean of the blades
        modes = len(self.bent) // 2
        # mean, cosine and sine components of the blades' deflections, then the twist of a shaft that twists
        self.bending = np.zeros(3 * modes + (scene.model.shaft is not None))
        self.bending_slope = None
        self.cyclic = np.zeros((2 * modes, 2))
        self.average = CyclicMean(scene, self.data, self.handle) if modes else None

    def rates(self):
        """Return the azimuth-averaged derivative at the current state and command, with actuators at rest."""
        rest_actuators(self.scene.model, self.x, self.u)
        if len(self.bending):
            self.settle_bending()
        else:
            self.settled_rates()
        if fault := self.scene.first_nonfinite_load(self.data):
            raise InputError(f"no steady state found for {label(self.scene)}: {fault}")
        return self.mean

    def settled_rates(self):
        """Fill the mean derivative, with internal states in equilibrium; return as fill_mean."""
        for block in self.scene.blocks:
            if block.steady == "settled":
                self.settle_internal(block)
        return self.fill_mean()

    def fill_mean(self):
        """Fill the mean derivative at the current state; return the rates of the cyclic components."""
        if self.average is None:
            mean_derivative(self.handle, self.x, self.u, AZIMUTHS, self.dx, self.mean)
            return self.cyclic
        return self.average(self.x, self.cyclic, self.u, self.azimuths, self.mean)

    def placed(self, azimuth):
        """Return the state at an azimuth (rad)."""
        return placed(self.x, azimuth, self.bent, self.cyclic)

    @property
    def azimuths(self):
        """Return the number of azimuths that are averaged: that of the start alone for a rotor at rest."""
        return 1 if self.x[State.ROTOR_SPEED] == 0.0 and self.average is not None else AZIMUTHS

    def settle_bending(self):
        """Set blades and shaft to their periodic state, with platform, tower and rotor fixed.

        Weight bends each blade once per turn: the state has the mean and the first harmonic.
        """
        modes, shaft = len(self.bent) // 2, self.scene.model.shaft
        bending, twist = np.split(self.bending, [3 * modes])
        bending = bending.reshape(modes, 3)

        def accelerations():
            speed = self.x[State.ROTOR_SPEED]
            self.x[self.bent[:modes]] = bending[:, :1]
            self.cyclic[:modes] = bending[:, 1:]
            self.cyclic[modes:] = speed * np.array([bending[:, 2], -bending[:, 1]]).T
            if shaft is not None:
                self.x[shaft.first] = twist[0]
            turned = self.settled_rates()
            found = np.column_stack([self.mean[self.bent[modes:, 0]], turned[modes:]]).ravel()
            return found if shaft is None else np.append(found, self.mean[shaft.first + 1])

        every = list(range(len(self.bending)))
        steps = [DEFLECTION_STEP] * bending.size + [TWIST_STEP] * len(twist)
        _, self.bending_slope = newton(accelerations, self.bending, every, steps, BENT, self.bending_slope)

    def settle_internal(self, block):
        """Set a block of internal states to its equilibrium, with all other states fixed.

        Raises: InputError if there is no equilibrium, as for an integrator.
        """
        if block.name == "wake":
            settle_wake(self.handle, self.x, self.dx)
            return
        rows = slice(block.offset, block.offset + block.size)
        if block.name == "airfoil":  # at rest after one step of this length
            self.fill_mean()
            self.x[rows] += STEADY * self.mean[rows]
            return
        if block.name == "radiation":  # zero for a platform at rest
            self.x[rows] = 0.0
            return

        def rates_at(values):
            self.x[rows] = values
            self.fill_mean()
            return self.mean[rows].copy()

        values = self.x[rows].copy()
        for _ in range(SETTLING):
            rates = rates_at(values)
            steps = 1e-6 * np.maximum(1.0, np.abs(values))
            slopes = np.array([(rates_at(values + step) - rates) / step.sum() for step in np.diag(steps)]).T
            try:
                change = np.linalg.solve(slopes, rates)
            except np.linalg.LinAlgError:
                change = np.full(block.size, np.nan)
            if not np.isfinite(change).all():
                raise InputError(
                    f"{block.name}: its states have no steady value: their rates must depend on them"
                )
            values = values - change
            if np.abs(change).max() <= 1e-12 * np.maximum(1.0, np.abs(values)).max():
                break
        self.x[rows] = values

    def rotor_acceleration(self, rotor_speed, blade_pitch):
        """Return the rotor acceleration, rad/s2, for the static torque curve and a tower at rest."""
        ratio = self.scene.turbine.drivetrain.gear_ratio
        self.x[State.ROTOR_SPEED] = rotor_speed
        self.u[Command.GENERATOR_TORQUE] = generator_torque(ratio * rotor_speed, blade_pitch, self.curve)
        self.set_pitch(blade_pitch)
        rates, model = self.rates(), self.scene.model
        if model.tower is None:
            return rates[State.ROTOR_SPEED]
        # far from equilibrium the nacelle accelerates with the rotor: remove this part from the imbalance
        body = model.rigid_body
        return rates[State.ROTOR_SPEED] + body.coupling / body.rotor_row * self._shaft_turning(rates)

    def _shaft_turning(self, rates):
        """Return the nacelle's angular acceleration about the shaft, rad/s2, for a turbine at rest."""
        tower = self.scene.model.tower
        bent, bending = self.x[self.deflections()], rates[[self._acceleration(i) for i in self.deflections()]]
        a, b = tower.slope[0::2] @ bent[0::2], -tower.slope[1::2] @ bent[1::2]  # about y, then about x
        about_y, about_x = tower.slope[0::2] @ bending[0::2], -tower.slope[1::2] @ bending[1::2]
        turned_y = np.array([[cos(a), 0.0, sin(a)], [0.0, 1.0, 0.0], [-sin(a), 0.0, cos(a)]])
        turned_x = np.array([[1.0, 0.0, 0.0], [0.0, cos(b), -sin(b)], [0.0, sin(b), cos(b)]])
        carried = (turned_y @ turned_x).T @ rates[State.WX : State.WZ + 1]
        relative = np.array([about_x, about_y * cos(b), -about_y * sin(b)])
        structure = self.scene.model.structure
        shaft = np.array([structure.tilt_cosine, 0.0, -structure.tilt_sine])
        return shaft @ (carried + relative)

    def set_pitch(self, blade_pitch):
        """Set the pitch (rad) of all blades, and its command."""
        self.x[list(self.scene.pitch_states)] = blade_pitch
        self.u[Command.BLADE_PITCH :] = blade_pitch

    def settle_rotor(self):
        """Set rotor speed, blade pitch and torque to steady values at the current platform position."""
        turbine = self.scene.turbine
        drive = turbine.pitch_drive
        wind, rated, finest = self.scene.wind_speed, turbine.rated_rotor_speed, drive.minimum
        slow = 0.02 * rated
        if wind is None or wind <= 0.0:
            speed, pitch = 0.0, min(max(0.0, finest), drive.maximum)
        elif wind > turbine.cut_out_wind_speed:
            speed, pitch = 0.0, min(FEATHERED, drive.maximum)
        elif self.rotor_acceleration(rated, finest) > 0.0:
            speed, pitch = rated, self._root(lambda b: self.rotor_acceleration(rated, b), finest, 0.8)
        elif self.rotor_acceleration(slow, finest) <= 0.0:
            speed, pitch = 0.0, finest
        else:
            speed, pitch = self._root(lambda w: self.rotor_acceleration(w, finest), slow, rated), finest
        self.rotor_acceleration(speed, pitch)

    def _root(self, excess, low, high):
        """Return the zero of the rotor acceleration. Raises: InputError if no zero is bracketed."""
        if not excess(low) * excess(high) <= 0.0:
            raise self.refusal("where no rotor speed and blade pitch balance the torque")
        return brentq(excess, low, high, xtol=1e-14, rtol=1e-14)

    def motions(self):
        """Return the indices of the platform motions that are free in the scene."""
        body = self.scene.model.rigid_body
        if body.platform_fixed:
            return []
        return [0, 1, 2, 3, 4, 5] if body.plane is None else [0, 2, 4]

    def deflections(self):
        """Return the indices of the deflections of a flexible tower."""
        tower = self.scene.model.tower
        return [] if tower is None else list(range(tower.first, tower.first + len(tower.slope)))

    def positions(self):
        """Return the indices of the platform's motions and of the tower's deflections."""
        return self.motions() + self.deflections()

    def free_states(self):
        """Return the indices of the unknowns of a trim: positions, and pitch or speed of a rotating rotor."""
        positions, wind, turbine = self.positions(), self.scene.wind_speed, self.scene.turbine
        if wind is None or not 0.0 < wind <= turbine.cut_out_wind_speed:
            return positions
        if self.x[State.BLADE_PITCH] > turbine.pitch_drive.minimum:
            return [*positions, int(State.BLADE_PITCH)]
        return [*positions, int(State.ROTOR_SPEED)] if self.x[State.ROTOR_SPEED] > 0.0 else positions

    def residual(self, free):
        """Return the accelerations of the free states, which are zero in the steady state."""
        if free[-1:] in ([State.BLADE_PITCH], [State.ROTOR_SPEED]):
            self.rotor_acceleration(self.x[State.ROTOR_SPEED], self.x[State.BLADE_PITCH])
        else:
            self.rates()
        return self.mean[[self._acceleration(index) for index in free]]

    def _acceleration(self, index):
        """Return the index of the state whose rate is the residual of a free state."""
        if index in (State.BLADE_PITCH, State.ROTOR_SPEED):
            return State.ROTOR_SPEED
        return State.VX + index if index < State.AZIMUTH else index + len(self.deflections())

    def jacobian(self, free):
        """Return the derivatives of the residual by the free states, from central differences."""
        return jacobian(lambda: self.residual(free), self.x, free, self._steps(free))

    def _steps(self, free):
        return [DIFFERENCE_STEPS.get(index, DEFLECTION_STEP) for index in free]

    def settle(self, free):
        """Solve for zero acceleration of the free states; return the largest residual."""

        def residual():
            value = self.residual(free)
            if self.start is None:  # at the first call the platform is undisplaced
                self.start = evaluated(self.x, self.data)
            return value

        size, slope = newton(residual, self.x, free, self._steps(free), TOLERANCE)
        if slope is not None:
            self.slope = self._of_motions(slope)
        return size

    def _of_motions(self, jacobian):
        """Return the block of a Jacobian for the platform motions."""
        n = len(self.motions())
        return jacobian[:n, :n]

    def refusal(self, ending=None):
        """Return the InputError of a search that failed at the current state; ending: as in unbalanced."""
        self.rates()
        end = evaluated(self.x, self.data)
        return InputError(unbalanced(self.scene, self.start or end, end, ending))

    def check(self):
        """Refuse an impossible state of the platform, and warn of an implausible one."""
        rest = self.x.copy()

        def fresh_slope():
            self.x[:] = rest
            return self._of_motions(self.jacobian(self.motions()))

        check_equilibrium(self.scene, rest, self.start, self.slope, fresh_slope)


def jacobian(residual, array, entries, steps):
    """Return the derivatives of residual() by entries of an array, from central differences."""
    columns = [
        central_difference(residual, array, index, step) for index, step in zip(entries, steps, strict=True)
    ]
    return np.array(columns).T


def newton(residual, array, entries, steps, tolerance, slope=None):
    """Solve residual() = 0 by Newton's method on entries of an array; return (largest residual, Jacobian).

    steps: of the differences; slope: Jacobian at a state nearby, or None. The Jacobian is kept while the
    residual falls tenfold per iteration. A step that does not lower the residual is halved, because far from
    the solution lines become taut within metres.
    """
    value = residual()
    size = np.max(np.abs(value))
    kept = slope is not None
    for _ in range(NEWTON_ROUNDS):
        if size < tolerance:
            break
        fresh = not kept
        if fresh:
            there = jacobian(residual, array, entries, steps)
            if not np.isfinite(there).all():
                break
            slope, kept = there, True
        # least squares: without moorings there is no restoring in surge and sway, which stay unchanged
        change = np.linalg.lstsq(slope, -value, rcond=1e-9)[0]
        before, start = size, array[entries].copy()
        for _ in range(HALVINGS):
            array[entries] = start + change
            value = residual()
            size = np.max(np.abs(value))
            if size < before:
                break
            change *= 0.5
        if not size < before:
            if fresh:
                break  # limited by rounding
            array[entries] = start  # retry with a new Jacobian
            value, size = residual(), before
        if not size < 0.1 * before:
            kept = False
    return size, slope


def trim(scene: Scene, platform: str = "floating") -> OperatingPoint:
    """Return the OperatingPoint of a scene: the steady state in mean wind and flat waves.

    platform: "floating" solves for the six motions; "fixed" holds them at zero. Deflections of a flexible
    tower are solved for in both modes. Rotor speed and blade pitch follow the torque curve below rated and
    rated speed above; above the cut-out wind speed the rotor is parked with feathered blades, and without
    wind the rotor is at standstill.

    Raises: InputError for an unknown platform mode, if no steady state is found, or if the steady state is
    impossible (keel in the sea bed, tower base under water). Warns once of an implausible equilibrium.
    """
    check_scene(scene)
    key = (scene.plant, _mean_weather(scene), platform)
    return _TRIMS.get(key, lambda: _trim(scene, platform)).copy()


def _mean_weather(scene):
    """Return what a trim depends on besides the plant, which a box of wind makes another: not the seed."""
    aero = scene.model.aero
    wind = None if aero is None else aero.wind.shear_exponent
    return scene.wind_speed, wind, water_key(scene)


def water_key(scene):
    """Return the weather kind and strip nodes, which, besides the plant, affect the last bits of a trim."""
    hydro = scene.model.hydro
    quadrature = None if hydro is None else getattr(hydro.strips, "quadrature", None)
    return scene.weather_kind, None if quadrature is None else quadrature.table.shape


def _steady(scene, platform, rotor_fixed):
    """Return the _Steady of a scene. Raises: InputError for an unknown platform mode."""
    if platform not in PLATFORM_MODES:
        raise unknown("platform mode of trim", platform, PLATFORM_MODES)
    body = scene.model.rigid_body._replace(platform_fixed=platform == "fixed", rotor_fixed=rotor_fixed)
    return _Steady(without_fluctuations(scene).with_model(rigid_body=body))


def _trim(scene, platform):
    """Compute the OperatingPoint of a scene without the scene's cache."""
    steady = _steady(scene, platform, False)
    steady.settle_rotor()
    if steady.positions():
        for _ in range(OUTER_ROUNDS):
            # whether pitch or speed is free follows from the rotor's balance at the current platform position
            free = steady.free_states()
            steady.settle(free)
            steady.settle_rotor()
            if steady.free_states() == free and np.max(np.abs(steady.residual(free))) < 1e3 * TOLERANCE:
                break
        else:
            raise steady.refusal()
    return _point(scene, steady, platform)


def trim_prescribed(scene, rotor_speed, blade_pitch, platform="floating"):
    """Return the OperatingPoint with the rotor driven at a speed (rad/s) and a locked blade pitch (rad).

    This represents model tests with a motor-driven rotor: theory.md Eq. (20). Mean wind, flat waves.
    Raises: InputError as trim.
    """
    steady = _steady(scene, platform, True)
    steady.x[State.ROTOR_SPEED] = rotor_speed
    steady.set_pitch(blade_pitch)
    if steady.positions():
        remaining = steady.settle(steady.positions())
        if not remaining < 1e3 * TOLERANCE:
            raise steady.refusal()
    else:
        steady.rates()
    return _point(scene, steady, platform)


def _point(scene, steady, platform):
    """Return the OperatingPoint at the current state, with channels averaged over the azimuth."""
    rest_actuators(scene.model, steady.x, steady.u)
    rest_lines(scene, steady.x)
    x, command = steady.x, steady.u.copy()
    # blades with loads of their own turn once, others are alike after a third of a turn
    turns = 1 if scene.model.pitches is None or steady.azimuths == 1 else BLADES
    count = turns * steady.azimuths
    rows = [
        output_row(steady.handle, steady.placed(azimuth), command, 0.0, len(scene.channels))
        for azimuth in x[State.AZIMUTH] + turns * TURN * np.arange(count) / count
    ]
    state = steady.placed(x[State.AZIMUTH])
    row = to_units(np.mean(rows, axis=0), scene.n_lines, scene.load_names, scene.channel_groups)
    names = [channel.name for channel in scene.channels]
    values = {name: float(value) for name, value in zip(names, row, strict=True)}
    values["Azimuth"] = 0.0
    del values["Time"]
    if platform == "floating":
        steady.check()
    return OperatingPoint(values, state, command, scene.wind_speed, platform)
