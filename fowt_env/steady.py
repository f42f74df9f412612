"""Steady operating point of a scene, averaged over the rotor's azimuth, in its mean wind and still water."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.optimize import brentq

from fowt_env.channels import to_units
from fowt_env.dynamics import derivative
from fowt_env.errors import InputError, unknown
from fowt_env.jit import entry
from fowt_env.loads.drivetrain import build_torque_curve, generator_torque
from fowt_env.loads.rotor import wake_equilibrium
from fowt_env.state import State, pose_of
from fowt_env.step import output_row
from fowt_env.weather.wind import make_series, wind_now
from fowt_env.weather.wind_field import steady_field

AZIMUTHS = 12  # samples over the 120 degrees after which three blades repeat
NEWTON_ROUNDS = 40
TOLERANCE = 1e-11  # m/s2 and rad/s2 of remaining acceleration
OUTER_ROUNDS = 30
FEATHERED = 0.5 * pi
PLATFORM_MODES = ("floating", "fixed")


class OperatingPoint(Mapping):
    """Steady state as a mapping of OpenFAST channels, e.g. op["RotThrust"] in kN.

    Attributes: state (n_state,) and command (generator torque N m, blade pitch rad), both SI;
    wind_speed (m/s or None); platform ("floating" or "fixed").
    """

    def __init__(self, values, state, command, wind_speed, platform):
        self._values = values
        self.state = state
        self.command = command
        self.wind_speed = wind_speed
        self.platform = platform

    def __getitem__(self, name):
        if name not in self._values:
            raise unknown("channel", name, self._values)
        return self._values[name]

    def get(self, name, default=None):
        return self._values.get(name, default)

    def __contains__(self, name):
        return name in self._values

    def __iter__(self):
        return iter(self._values)

    def __len__(self):
        return len(self._values)

    def __repr__(self):
        shown = ("RotSpeed", "BldPitch1", "GenPwr", "RotThrust", "PtfmSurge", "PtfmPitch")
        text = ", ".join(f"{name} {self._values[name]:.4g}" for name in shown)
        return f"OperatingPoint({text}, platform={self.platform!r})"


def calm(scene, wind_speed=None):
    """The scene in steady mean wind and flat water: same types, so nothing is compiled anew."""
    parts = {}
    model = scene.model
    if model.waves is not None:
        # one component of no height stands for flat water: summing them all would only take longer
        waves = model.waves
        one = {
            name: getattr(waves, name)[:1].copy() for name in waves._fields if np.ndim(getattr(waves, name))
        }
        parts["waves"] = waves._replace(**one | {"amplitude": np.zeros(1), "velocity": np.zeros(1)})
    if model.sea is not None:
        parts["sea"] = model.sea._replace(weight=np.zeros_like(model.sea.weight))
    if model.wind is not None:
        speed = scene.wind_speed if wind_speed is None else wind_speed
        if model.wind_field is not None:
            factor = 1.0 if wind_speed is None else wind_speed / scene.wind_speed
            parts["wind_field"] = steady_field(model.wind_field, factor)
        parts["wind"] = make_series(
            np.zeros(1),
            np.array([[speed, 0.0, 0.0, 0.0, 0.0]]),
            reference_height=model.wind.reference_height,
            reference_length=model.wind.reference_length,
            shear_exponent=model.wind.shear_exponent,
        )
    return scene.with_model(**parts)


@entry
def mean_derivative(box, x, u, azimuths, dx, mean):
    """Mean of dx over the azimuths, into mean (n_state,)."""
    start = x[State.AZIMUTH]
    mean[:] = 0.0
    for i in range(azimuths):
        x[State.AZIMUTH] = start + i * (2.0 * pi / 3.0) / azimuths
        derivative(0.0, x, u, box.scene, box.work, dx)
        for j in range(x.shape[0]):
            mean[j] += dx[j] / azimuths
    x[State.AZIMUTH] = start


@entry
def settle_wake(box, x, dx):
    """Set the wake states of x to their steady values for the rest of it."""
    scene = box.scene
    wake_equilibrium(
        0.0, pose_of(x), x, wind_now(0.0, scene.wind), scene.wind, scene.wind_field,
        scene.rotor, scene.skew, scene.wake, dx, box.work.counters,
    )  # fmt: skip


@dataclass
class _Steady:
    """Residual evaluations of a calm scene about one state vector."""

    scene: object

    def __post_init__(self):
        self.box = self.scene.box()
        self.x = np.zeros(self.scene.n_state)
        self.u = np.zeros(2)
        self.dx = np.zeros_like(self.x)
        self.mean = np.zeros_like(self.x)
        self.curve = build_torque_curve(self.scene.turbine.torque_law)

    def rates(self):
        """Azimuth-averaged derivative at the present state and command."""
        if self.scene.model.wake is not None:
            settle_wake(self.box, self.x, self.dx)
        mean_derivative(self.box, self.x, self.u, AZIMUTHS, self.dx, self.mean)
        return self.mean

    def rotor_acceleration(self, rotor_speed, blade_pitch):
        """w_b' with the torque of the static curve, platform as it is."""
        ratio = self.scene.turbine.drivetrain.gear_ratio
        self.x[State.ROTOR_SPEED] = rotor_speed
        self.x[State.BLADE_PITCH] = blade_pitch
        self.u[0] = generator_torque(ratio * rotor_speed, blade_pitch, self.curve)
        self.u[1] = blade_pitch
        return self.rates()[State.ROTOR_SPEED]

    def settle_rotor(self):
        """Set rotor speed, blade pitch and torque to their steady values for the present platform."""
        turbine = self.scene.turbine
        drive = turbine.pitch_drive
        wind = self.scene.wind_speed
        if wind is None or wind <= 0.0:
            self.rotor_acceleration(0.0, min(max(0.0, drive.minimum), drive.maximum))
            return
        if wind > turbine.cut_out_wind_speed:
            self.rotor_acceleration(0.0, min(FEATHERED, drive.maximum))
            return
        rated = turbine.rated_rotor_speed
        finest = drive.minimum
        if self.rotor_acceleration(rated, finest) > 0.0:
            high = 0.8
            beta = brentq(lambda b: self.rotor_acceleration(rated, b), finest, high, xtol=1e-14, rtol=1e-14)
            self.rotor_acceleration(rated, beta)
            return
        slow = 0.02 * rated
        if self.rotor_acceleration(slow, finest) <= 0.0:
            self.rotor_acceleration(0.0, finest)
            return
        speed = brentq(lambda w: self.rotor_acceleration(w, finest), slow, rated, xtol=1e-14, rtol=1e-14)
        self.rotor_acceleration(speed, finest)

    def settle_platform(self):
        """Newton on the motions that the scene has for zero acceleration; returns the remaining one."""
        steps = np.array([1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5])
        free = [0, 1, 2, 3, 4, 5] if self.scene.model.body.plane is None else [0, 2, 4]
        for _ in range(NEWTON_ROUNDS):
            residual = self.rates()[State.VX : State.WZ + 1].copy()
            size = np.max(np.abs(residual))
            if size < TOLERANCE:
                return size
            jacobian = np.zeros((6, 6))
            for j in free:
                keep = self.x[j]
                self.x[j] = keep + steps[j]
                up = self.rates()[State.VX : State.WZ + 1].copy()
                self.x[j] = keep - steps[j]
                down = self.rates()[State.VX : State.WZ + 1].copy()
                self.x[j] = keep
                jacobian[:, j] = (up - down) / (2.0 * steps[j])
            # least squares: without moorings nothing restores surge and sway, which then stay as they are
            change = np.zeros(6)
            change[free] = np.linalg.lstsq(jacobian[np.ix_(free, free)], -residual[free], rcond=1e-9)[0]
            # far from the solution lines go taut within metres: limit one round to what they allow
            largest = np.max(np.abs(change) / np.array([5.0, 5.0, 5.0, 0.1, 0.1, 0.1]))
            if largest > 1.0:
                change /= largest
            self.x[:6] += change
        return np.max(np.abs(self.rates()[State.VX : State.WZ + 1]))


def trim(scene, platform="floating"):
    """OperatingPoint of a scene: steady state in its mean wind, waves flat.

    platform: "floating" finds the six motions too; "fixed" holds them at zero. Rotor speed and
    blade pitch follow the torque curve below rated and rated speed above; beyond the cut-out wind
    the rotor is parked with feathered blades, and without wind it stands.

    Raises: InputError for an unknown platform mode, or if no steady state is found.
    """
    if platform not in PLATFORM_MODES:
        raise unknown("platform mode of trim", platform, PLATFORM_MODES)
    held = platform == "fixed"
    body = scene.model.body._replace(platform_held=held, rotor_held=False)
    steady = _Steady(calm(scene).with_model(body=body))
    remaining = 0.0
    if held:
        steady.settle_rotor()
    else:
        for _ in range(OUTER_ROUNDS):
            before = steady.x[: State.WAKE].copy()
            steady.settle_rotor()
            remaining = steady.settle_platform()
            if np.max(np.abs(steady.x[: State.WAKE] - before)) < 1e-12:
                break
        if not remaining < 1e3 * TOLERANCE:
            raise InputError(
                f"no steady state found for {scene!r}: remaining acceleration {remaining:.2e} m/s2 or rad/s2"
            )
    return _point(scene, steady, platform)


def trim_held(scene, rotor_speed, blade_pitch, platform="floating"):
    """OperatingPoint with the rotor driven at a speed (rad/s) and a locked blade pitch (rad).

    For model tests, where a motor holds the rotor speed: theory.md Eq. (20). Mean wind, waves flat.
    Raises: InputError for an unknown platform mode, or if no steady state is found.
    """
    if platform not in PLATFORM_MODES:
        raise unknown("platform mode of trim_held", platform, PLATFORM_MODES)
    body = scene.model.body._replace(platform_held=platform == "fixed", rotor_held=True)
    steady = _Steady(calm(scene).with_model(body=body))
    steady.x[State.ROTOR_SPEED] = rotor_speed
    steady.x[State.BLADE_PITCH] = steady.u[1] = blade_pitch
    if platform == "floating":
        remaining = steady.settle_platform()
        if not remaining < 1e3 * TOLERANCE:
            raise InputError(
                f"no steady state found for {scene!r}: remaining acceleration {remaining:.2e} m/s2 or rad/s2"
            )
    return _point(scene, steady, platform)


def _point(scene, steady, platform):
    """OperatingPoint at the present state, channels averaged over the azimuth."""
    state, command = steady.x.copy(), steady.u.copy()
    rows = []
    for i in range(AZIMUTHS):
        x = state.copy()
        x[State.AZIMUTH] += i * (2.0 * pi / 3.0) / AZIMUTHS
        rows.append(output_row(steady.box, x, command, 0.0, len(scene.channels)))
    row = to_units(np.mean(rows, axis=0), scene.n_lines)
    names = [channel.name for channel in scene.channels]
    values = {name: float(value) for name, value in zip(names, row, strict=True)}
    values["Azimuth"] = 0.0
    del values["Time"]
    return OperatingPoint(values, state, command, scene.wind_speed, platform)
