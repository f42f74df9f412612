"""Defines individual pitch control: PI law for torque and mean pitch, cyclic pitch against 1P loads.

The out-of-plane root moments are transformed to the hub's tilt and yaw moment M
(controllers/ipc/design.py). The moment without cyclic pitch theta is estimated as M - G theta with the
slope G of the root moment, scheduled on the mean pitch. The estimate passes a notch at 3P, and theta follows
-(M - G theta)/G with a first-order lag; without the notch this is integral control of M with the gain
bandwidth/|G|. The azimuth of the inverse transformation leads by the lag of pitch drive and control period
at 1P, which decouples tilt and yaw.

The cyclic amplitude is limited to `amplitude`, by the drive's rate at the present rotor speed, and by the
distance of the mean pitch from the drive's limits, without windup. With a `bound` theta follows -(1 -
bound/|M - G theta|) (M - G theta)/G, and zero within the bound: output-constrained control of the combined
tilt and yaw, Hummel, Kober and Mulders, Wind Energ. Sci. 10, 2005-2024, 2025. There M is that of the flapwise
moments M_oop cos(pitch) + M_ip sin(pitch), which fatigue the blade root: to the load of shear they add the
part sin(pitch) of the weight's in-plane moment at 1P. The yaw moment, which yaws the
platform, is cancelled only below `yaw_corner`, and the tilt moment, whose control excites sway and roll,
passes `tilt_notches`.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from math import cos, exp, hypot, inf, pi, sin, tan

import numpy as np

from fowt_env.controllers.gains import platform_frequency
from fowt_env.controllers.ipc.design import BANDWIDTH, lead_time, root_slope
from fowt_env.controllers.pi import END, PI, Memory, Parameter, PISettings, pi_step
from fowt_env.controllers.settings import NOT_NEGATIVE, POSITIVE, POSITIVE_OR_INF, Settings
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.drivetrain import clamp, rate_limit
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.state import BLADES, Command, State

TILT_NOTCHES = 3  # at most, in addition at 3P
COEFFICIENTS = 5  # of a notch: b0, b1, b2, a1, a2
NYQUIST_SHARE = 0.9  # of the Nyquist frequency, upper limit of notch frequencies
BELOW_PLATFORM = 0.25  # of the slowest platform frequency: corner of the yaw moment of ipc_floating
CONSTRAINED_BOUND = 0.17  # of the largest root moment in steady wind, bound of ipc_constrained


@dataclass(frozen=True)
class IPCSettings(Settings):
    """Defines the cyclic pitch control. Raises: InputError naming the key, value and allowed range."""

    RANGES = {
        "bandwidth": POSITIVE | {"high": 1.0, "allowed": "above 0 and at most 1"},
        "amplitude": POSITIVE | {"high": 0.5, "allowed": "above 0 and at most 0.5"},
        "rate_share": POSITIVE | {"high": 1.0, "allowed": "above 0 and at most 1"},
        **dict.fromkeys(("notch_damping", "tilt_damping"), POSITIVE),
        "bound": NOT_NEGATIVE,
        "yaw_corner": POSITIVE_OR_INF,
    }

    bandwidth: float = BANDWIDTH
    amplitude: float = 5.0 * DEGREE  # rad, largest cyclic pitch
    rate_share: float = 0.8  # fraction of the drive's rate limit available to the cyclic pitch
    notch_damping: float = 0.5  # of the notch at 3P: half its width over its frequency
    lead: bool = True  # whether the azimuth leads by the drive's lag
    bound: float = 0.0  # tolerated moment, fraction of the largest steady root moment
    tilt_notches: tuple[float, ...] = ()  # rad/s, platform frequencies removed from the tilt moment
    tilt_damping: float = 0.5  # of these notches
    yaw_corner: float = inf  # rad/s, of a first-order low pass of the yaw moment; inf: none

    def __post_init__(self):
        super().__post_init__()
        if len(self.tilt_notches) > TILT_NOTCHES:
            raise InputError(
                f"tilt_notches: {len(self.tilt_notches)} frequencies: must be at most {TILT_NOTCHES}"
            )
        for frequency in self.tilt_notches:
            check_number("tilt_notches", frequency, **POSITIVE)


class CyclicParameter(IntEnum):
    """Enumerates the law's parameters that follow those of the PI law."""

    DECAY = END  # fraction of the distance to the target that remains after one period
    SLOPE = DECAY + 1  # G at zero pitch, N m/rad
    DOUBLING = DECAY + 2  # rad
    AMPLITUDE = DECAY + 3  # rad
    RATE = DECAY + 4  # rad/s, of the cyclic pitch
    NOTCH_DAMPING = DECAY + 5
    LEAD_TIME = DECAY + 6  # s
    BOUND = DECAY + 7  # N m
    YAW_DECAY = DECAY + 8  # fraction of the yaw moment's low pass that remains after one period
    FLAPWISE = DECAY + 9  # 1: flapwise root moments, 0: moments out of the rotor plane
    NOTCHES = DECAY + 10  # coefficients of the tilt moment's notches


N_PARAMETERS = CyclicParameter.NOTCHES + TILT_NOTCHES * COEFFICIENTS


class CyclicMemory(IntEnum):
    """Enumerates the law's memory entries that follow those of the PI law."""

    STARTED = len(Memory)  # 0 before the first period
    BLADES = STARTED + 1  # last commands of the three blades, rad
    TILT = STARTED + 4  # cyclic pitch, rad
    YAW = STARTED + 5
    SLOW_YAW = STARTED + 6  # N m, of the yaw moment's low pass
    FILTERS = STARTED + 7  # two states of each notch: tilt and yaw at 3P, tilt at the platform's frequencies


N_MEMORY = CyclicMemory.FILTERS + 2 * (2 + TILT_NOTCHES)


@kernel
def notch_coefficients(frequency, damping, dt):
    """Return (b0, b1, b2, a1, a2) of (s^2 + w^2)/(s^2 + 2 damping w s + w^2) at w = frequency, rad/s.

    Bilinear transformation, exact at w.
    """
    k = tan(0.5 * min(frequency * dt, NYQUIST_SHARE * pi))
    scale = 1.0 / (1.0 + 2.0 * damping * k + k * k)
    b0, b1 = (1.0 + k * k) * scale, 2.0 * (k * k - 1.0) * scale
    return b0, b1, b0, b1, (1.0 - 2.0 * damping * k + k * k) * scale


@kernel
def filtered(value, coefficients, memory, at, started):
    """Return the output of a second-order filter and advance its two states in memory by one period.

    If not started, the states are first initialised to the steady state of this value.
    """
    b0, b1, b2, a1, a2 = coefficients
    if not started:
        memory[at + 1] = (b2 - a2) * value
        memory[at] = (b1 - a1) * value + memory[at + 1]
    result = b0 * value + memory[at]
    memory[at] = b1 * value - a1 * result + memory[at + 1]
    memory[at + 1] = b2 * value - a2 * result
    return result


@kernel
def without_platform(tilt, yaw, parameters, memory, started):
    """Return (tilt, yaw) moment (N m) after tilt notches and the low pass of the yaw moment."""
    for k in range(TILT_NOTCHES):
        i = CyclicParameter.NOTCHES + k * COEFFICIENTS
        c = parameters[i], parameters[i + 1], parameters[i + 2], parameters[i + 3], parameters[i + 4]
        tilt = filtered(tilt, c, memory, CyclicMemory.FILTERS + 2 * (2 + k), started)
    decay = parameters[CyclicParameter.YAW_DECAY]
    slow = (1.0 - decay) * yaw + decay * memory[CyclicMemory.SLOW_YAW]
    memory[CyclicMemory.SLOW_YAW] = slow
    return tilt, slow


@kernel
def share_beyond(tilt, yaw, bound):
    """Return the fraction of a moment (N m) by which its magnitude exceeds the bound; 0 within the bound."""
    magnitude = hypot(tilt, yaw)
    return 0.0 if magnitude <= bound else 1.0 - bound / magnitude


@kernel
def greatest_amplitude(mean_pitch, rotor_speed, parameters):
    """Return the largest permitted cyclic pitch (rad) at a mean pitch (rad) and rotor speed, rad/s."""
    p = parameters
    room = min(mean_pitch - p[Parameter.PITCH_MINIMUM], p[Parameter.PITCH_MAXIMUM] - mean_pitch)
    room = min(room, p[CyclicParameter.AMPLITUDE])
    if rotor_speed > 0.0:
        room = min(room, p[CyclicParameter.RATE] / rotor_speed)
    return max(room, 0.0)


@kernel
def cyclic_step(parameters, memory, measurement, command):
    """Advance the cyclic pitch by one period and add it to the mean pitch in command."""
    p = parameters
    dt, mean = p[Parameter.CONTROL_DT], command[Command.BLADE_PITCH]
    rotor_speed = memory[Memory.FILTERED_SPEED] / p[Parameter.GEAR_RATIO]
    azimuth = measurement[N_MEASUREMENTS + BladeMeasure.AZIMUTH]
    tilt = yaw = 0.0
    for blade in range(BLADES):
        psi = azimuth + 2.0 * pi * blade / BLADES
        moment = measurement[N_MEASUREMENTS + BladeMeasure.ROOT_OUT_OF_PLANE_1 + blade]
        if p[CyclicParameter.FLAPWISE] > 0.5:
            pitch = measurement[N_MEASUREMENTS + BladeMeasure.BLADE_PITCH_1 + blade]
            in_plane = measurement[N_MEASUREMENTS + BladeMeasure.ROOT_IN_PLANE_1 + blade]
            moment = moment * cos(pitch) + in_plane * sin(pitch)
        tilt += 2.0 / BLADES * moment * cos(psi)
        yaw += 2.0 / BLADES * moment * sin(psi)
    slope = p[CyclicParameter.SLOPE] * (1.0 + mean / p[CyclicParameter.DOUBLING])
    along, across = memory[CyclicMemory.TILT], memory[CyclicMemory.YAW]
    started = memory[CyclicMemory.STARTED] > 0.5
    memory[CyclicMemory.STARTED] = 1.0
    third = notch_coefficients(BLADES * abs(rotor_speed), p[CyclicParameter.NOTCH_DAMPING], dt)
    at = CyclicMemory.FILTERS
    tilt = filtered(tilt - slope * along, third, memory, at, started)
    yaw = filtered(yaw - slope * across, third, memory, at + 2, started)
    tilt, yaw = without_platform(tilt, yaw, p, memory, started)

    fraction, follow = share_beyond(tilt, yaw, p[CyclicParameter.BOUND]), 1.0 - p[CyclicParameter.DECAY]
    along += follow * (-fraction * tilt / slope - along)
    across += follow * (-fraction * yaw / slope - across)
    limit, amplitude = greatest_amplitude(mean, rotor_speed, p), hypot(along, across)
    if amplitude > limit:
        along, across = along * limit / amplitude, across * limit / amplitude
    memory[CyclicMemory.TILT], memory[CyclicMemory.YAW] = along, across

    step = dt * p[Parameter.PITCH_RATE_LIMIT]
    for blade in range(BLADES):
        psi = azimuth + 2.0 * pi * blade / BLADES + rotor_speed * p[CyclicParameter.LEAD_TIME]
        target = mean + along * cos(psi) + across * sin(psi)
        target = clamp(target, p[Parameter.PITCH_MINIMUM], p[Parameter.PITCH_MAXIMUM])
        pitch = rate_limit(memory[CyclicMemory.BLADES + blade], target, step)
        memory[CyclicMemory.BLADES + blade] = pitch
        command[Command.BLADE_PITCH + blade] = pitch


@control_kernel
def ipc_law(parameters, memory, measurement, command):
    """Command torque and mean pitch of the PI law, and the cyclic pitch of each blade."""
    speed, pitch = measurement[Measure.GENERATOR_SPEED], measurement[Measure.BLADE_PITCH]
    pi_step(parameters, memory, speed, pitch, command)
    cyclic_step(parameters, memory, measurement, command)


class IPC(PI):
    """Implements the PI law with the cyclic pitch of an IPCSettings; call prepare(scene) before reset."""

    kernel = staticmethod(ipc_law)
    individual = True
    flapwise = False  # whether it acts on flapwise moments
    inputs = (
        *PI.inputs, "azimuth", "blade_pitch_1", "blade_pitch_2", "blade_pitch_3",
        "root_out_of_plane_1", "root_out_of_plane_2", "root_out_of_plane_3",
    )  # fmt: skip

    def __init__(self, settings, cyclic, control_dt, name="ipc"):
        extra = np.full(N_PARAMETERS - END, np.nan)  # until prepare
        super().__init__(settings, control_dt, name, N_MEMORY - len(Memory), extra)
        self.cyclic = cyclic

    def cyclic_settings(self, scene):
        """Return the IPCSettings for a scene."""
        return self.cyclic

    def prepare(self, scene):
        """Set the parameters for the scene's turbine and, if the law needs it, its platform."""
        super().prepare(scene)
        turbine, cyclic, p = scene.turbine, self.cyclic_settings(scene), self.parameters
        slope, rated = root_slope(turbine), turbine.rated_rotor_speed
        p[CyclicParameter.DECAY : CyclicParameter.NOTCHES] = (
            exp(-self.law_dt * cyclic.bandwidth * rated),
            slope.at_zero,
            slope.doubling,
            cyclic.amplitude,
            cyclic.rate_share * turbine.pitch_drive.rate_limit,
            cyclic.notch_damping,
            lead_time(turbine, self.law_dt) if cyclic.lead else 0.0,
            cyclic.bound * slope.moment,
            exp(-self.law_dt * cyclic.yaw_corner),  # 0 without a corner
            float(self.flapwise),
        )
        coefficients = np.zeros((TILT_NOTCHES, COEFFICIENTS))
        coefficients[:, 0] = 1.0  # all-pass
        for k, frequency in enumerate(cyclic.tilt_notches):
            coefficients[k] = notch_coefficients(float(frequency), cyclic.tilt_damping, self.law_dt)
        p[CyclicParameter.NOTCHES :] = coefficients.ravel()

    def reset(self, measurement):
        """Start as PI.reset, each blade from its measured pitch and with no cyclic pitch.

        Raises: InputError if prepare() was not called.
        """
        if np.isnan(self.parameters[CyclicParameter.SLOPE]):
            raise InputError(f"controller {self.name!r}: call prepare(scene) before reset(measurement)")
        super().reset(measurement)
        self.memory[CyclicMemory.STARTED :] = 0.0
        pitches = [getattr(measurement.blades, f"blade_pitch_{i + 1}") for i in range(BLADES)]
        self.memory[CyclicMemory.BLADES : CyclicMemory.BLADES + BLADES] = pitches


class FlapwiseIPC(IPC):
    """Implements IPC on the flapwise moments of the blade roots."""

    flapwise = True
    inputs = (*IPC.inputs, "root_in_plane_1", "root_in_plane_2", "root_in_plane_3")


class FloatingIPC(IPC):
    """Implements IPC without action at the platform's frequencies of sway, roll and yaw."""

    inputs = (*IPC.inputs, "plant_model")

    def cyclic_settings(self, scene):
        """Return the IPCSettings with notches at sway and roll, and a corner below the slowest frequency."""
        sway, roll, yaw = (platform_frequency(scene, m) for m in (State.SWAY, State.ROLL, State.YAW))
        corner = BELOW_PLATFORM * min(sway, roll, yaw)
        return replace(self.cyclic, tilt_notches=(sway, roll), yaw_corner=corner)


def ipc(turbine, control_dt):
    """Apply the PI law with 1P individual pitch control: hub tilt and yaw moment to cyclic pitch."""
    return IPC(PISettings.published(turbine), IPCSettings(), control_dt, "ipc")


def ipc_constrained(turbine, control_dt):
    """Apply ipc to flapwise moments above a bound: most of its load reduction for a third of its travel."""
    settings = IPCSettings(bound=CONSTRAINED_BOUND)
    return FlapwiseIPC(PISettings.published(turbine), settings, control_dt, "ipc_constrained")


def ipc_floating(turbine, control_dt):
    """Apply ipc without exciting sway, roll and yaw of the platform."""
    return FloatingIPC(PISettings.published(turbine), IPCSettings(), control_dt, "ipc_floating")
