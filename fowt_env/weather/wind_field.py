"""Reads and generates boxes of full-field wind, and checks them against the rotor.

u(X, Y, Z, t) = box(t + shift - X/U, Y, Z), trilinear in time and both coordinates, sampled at every blade
station and at the tower. As in InflowWind the shift is half the grid width over the mean wind, so that the
wind upstream by half a width is known at the start, and below the grid the wind decreases linearly to zero
at the still-water level; beside and above the grid it is that of the edge (read_box rejects grids smaller
than the rotor). Sources of boxes: TurbSim files (turbsim.py), user arrays, Mann turbulence (hipersim).
"""

from dataclasses import dataclass
from math import ceil

import numpy as np

from fowt_env.descriptions.checks import check_in_range
from fowt_env.descriptions.iec import length_scale, ntm_sigma
from fowt_env.descriptions.wind import BOX_STEPS, FIELD_KINDS, MOVING_SPEEDS, checked_keys, wind_of
from fowt_env.errors import InputError
from fowt_env.plant.aero.wind_field import WindField, field_at
from fowt_env.plant.compile.decorators import kernel
from fowt_env.weather.turbsim import read_bts
from fowt_env.weather.turbulence import drawn_ntm_sigma

MARGIN = 75.0  # m of platform drift against the wind that a box must still cover at the end of a run
DISK_RADII, DISK_AZIMUTHS = 12, 36  # points of the rotor average
PROFILE_STEP = 1.0  # m of height between the points of a steady profile


def is_field(spec):
    """Return whether a wind specification asks for a box of full-field wind."""
    spec = wind_of(spec)
    kind = spec.get("kind") if isinstance(spec, dict) else None
    return isinstance(spec, WindBox) or (isinstance(kind, str) and kind in FIELD_KINDS)


@dataclass(frozen=True, eq=False, repr=False)
class WindBox:
    """A box in memory, before it becomes a WindField: what it is, where its grid lies, how it travels."""

    velocity: np.ndarray  # (n_time, n_z, n_y, 3) float32 m/s
    y: np.ndarray  # (n_y,) m, evenly increasing
    z: np.ndarray  # (n_z,) m above still water
    dt: float  # s between slices
    speed: float  # m/s at which it travels
    periodic: bool
    shift: float  # s

    def __repr__(self):
        n_time, n_z, n_y, _ = self.velocity.shape
        return f"WindBox({n_time} x {self.dt:g} s, {n_y} x {n_z} points, {self.speed:g} m/s)"

    @property
    def usable(self):
        """Return seconds of a run that the box covers, drift of MARGIN metres included; inf if it repeats."""
        if self.periodic:
            return float("inf")
        return (self.velocity.shape[0] - 1) * self.dt - self.shift - MARGIN / self.speed

    def at(self, time, X, Y, Z):
        """Return (n, 3) m/s at times (n,) and points, for tables and tests; one call of field_at each."""
        field = self.field()
        points = np.broadcast_arrays(*(np.atleast_1d(np.asarray(p, dtype=float)) for p in (time, X, Y, Z)))
        return np.array([field_at(*point, field) for point in zip(*points, strict=True)])

    def field(self):
        """Return the WindField of the box."""
        dy, dz = self.y[1] - self.y[0], self.z[1] - self.z[0]
        numbers = (1.0 / self.dt, self.shift, 1.0 / self.speed, self.y[0], self.z[0], 1.0 / dy, 1.0 / dz)
        velocity = np.require(self.velocity, np.float32, "CAW")  # the one type that kernels are compiled for
        return WindField(velocity, *map(float, numbers), bool(self.periodic))


def read_box(spec, *, hub_height, rotor_diameter, shear_exponent=0.0, seed=0, duration=600.0):
    """Return the WindBox of a specification with "kind" bts, box or mann (or of a WindBox: itself).

    bts   path; periodic (None: as the file says); shift (s, None: half the grid width over the mean wind)
    box   u (n_time, n_z, n_y) m/s, optionally v and w; y, z (m); dt (s); speed (m/s)
    mann  speed (m/s), class and sigma of the IEC normal turbulence model, seed, dt; hipersim makes the box
    Raises: InputError naming the key and what is allowed, and where the grid does not hold the rotor.
    """
    if isinstance(spec, WindBox):
        box = spec
    else:
        make = _MAKERS[spec["kind"]]
        box = make(checked_keys(spec), hub_height, rotor_diameter, shear_exponent, seed, duration)
    reach = 0.5 * rotor_diameter
    rise = box.z - hub_height
    if max(box.y[0], rise[0]) > -reach or min(box.y[-1], rise[-1]) < reach:
        raise InputError(
            f"wind: the grid from y = {box.y[0]:g} to {box.y[-1]:g} m and z = {box.z[0]:g} to {box.z[-1]:g} m"
            f" must hold the rotor, {reach:g} m about (0, {hub_height:g})"
        )
    return box


def _even(name, line):
    """Return a grid line as float64, evenly increasing. Raises: InputError."""
    steps = np.diff(line)
    if line.size < 2 or not steps.min() > 0.0 or np.ptp(steps) > 1e-3 * steps.mean():
        raise InputError(f"wind.{name}: must be at least 2 evenly increasing numbers (m)")
    return np.linspace(line[0], line[-1], line.size)


def _from_arrays(values, hub_height, rotor_diameter, shear_exponent, seed, duration):
    u, y, z = values["u"], _even("y", values["y"]), _even("z", values["z"])
    if u.shape[1:] != (z.size, y.size):
        raise InputError(f"wind.u has shape {u.shape}: must be (n_time, {z.size}, {y.size}), as z and y say")
    parts = [u, *(np.zeros_like(u) if values[key] is None else values[key] for key in ("v", "w"))]
    for key, part in zip("vw", parts[1:], strict=True):
        if part.shape != u.shape:
            raise InputError(f"wind.{key} has shape {part.shape}: must be that of u, {u.shape}")
    velocity = np.stack(parts, axis=-1).astype(np.float32)
    return _box(velocity, y, z, values["dt"], values["speed"], values["periodic"], values["shift"])


def _box(velocity, y, z, dt, speed, periodic, shift=None):
    """Return a WindBox; a shift of None is half the grid width over the mean wind."""
    shift = 0.5 * (y[-1] - y[0]) / speed if shift is None else float(shift)
    return WindBox(velocity, y, z, dt, speed, periodic, float(shift))


def _from_bts(values, *_):
    velocity, y, z, dt, speed, repeats = read_bts(values["path"])
    y, z = _even("y", y), _even("z", z)
    for key, value, limits in (("dt", dt, BOX_STEPS), ("speed", speed, MOVING_SPEEDS)):
        check_in_range(f"wind.path = {str(values['path'])!r}: {key}", value, *limits)
    periodic = repeats if values["periodic"] is None else values["periodic"]
    return _box(velocity, y, z, dt, speed, periodic, values["shift"])


def _from_mann(values, hub_height, rotor_diameter, shear_exponent, seed, duration):
    """Mann turbulence of the IEC (length 0.8 Lambda_1, anisotropy 3.9), scaled to sigma_1 at the hub."""
    try:
        from hipersim import MannTurbulenceField
    except ImportError:
        raise InputError(
            "Mann boxes are made by hipersim, which is not installed: pip install 'fowt-env[mann]'"
        ) from None
    speed, dt = values["speed"], values["dt"]
    seed = seed if values["seed"] is None else values["seed"]
    n_time = 2 ** ceil(np.log2((duration + 2.0 * rotor_diameter / speed) / dt))
    n_side = 32
    step = 1.2 * rotor_diameter / (n_side - 1)
    grid = {"Nxyz": (n_time, n_side, n_side), "dxyz": (speed * dt, step, step)}
    made = MannTurbulenceField.generate(L=0.8 * length_scale(hub_height), Gamma=3.9, **grid, seed=seed)
    # x of that box points downwind: the slice that arrives first is the one farthest downstream
    velocity = np.transpose(np.asarray(made.uvw), (1, 3, 2, 0))[::-1].astype(np.float32)
    middle = n_side // 2
    drawn = values["sigma"] == "drawn"  # as the rotor-averaged wind of the same seed draws it
    sigma = drawn_ntm_sigma(speed, values["class"], seed) if drawn else ntm_sigma(speed, values["class"])
    velocity *= sigma / velocity[:, middle, middle, 0].std()
    line = step * (np.arange(n_side) - 0.5 * (n_side - 1))
    z = hub_height + line
    exponent = shear_exponent if values["shear_exponent"] is None else values["shear_exponent"]
    velocity[..., 0] += (speed * (np.maximum(z, 1.0) / hub_height) ** exponent)[None, :, None]
    return _box(velocity, line, z, dt, speed, True)


_MAKERS = {"bts": _from_bts, "box": _from_arrays, "mann": _from_mann}


# --------------------------------------------------------------------------- derived winds


def steady_field(field, factor=1.0):
    """The field's mean over time as a steady wind, times a factor; same type, so nothing is recompiled."""
    mean = field.velocity.mean(axis=0, dtype=np.float64, keepdims=True) * factor
    return field._replace(velocity=np.ascontiguousarray(mean, dtype=np.float32))


def profile_field(speed, exponent, hub_height, rotor_diameter):
    """Return the WindField of a steady wind that follows the power law over the height and is alike across.

    speed: m/s at the hub. Of the kernels' types, in place of any box.
    """
    z = np.arange(PROFILE_STEP, hub_height + rotor_diameter + PROFILE_STEP, PROFILE_STEP)
    velocity = np.zeros((1, len(z), 2, 3))
    velocity[0, :, :, 0] = (speed * (z / hub_height) ** exponent)[:, None]
    side = np.array([-rotor_diameter, rotor_diameter])
    return WindBox(velocity, side, z, 1.0, max(speed, 1.0), False, 0.0).field()


def hub_speed(box, hub_height):
    """Return the mean horizontal wind (m/s) of the box at the hub."""
    field = steady_field(box.field())
    u, v, _ = field_at(0.0, 0.0, 0.0, float(hub_height), field)
    return float(np.hypot(u, v))


def hub_wind(box, hub_height):
    """Return (time, value (n, 3)): u, v, w of the box at the hub, X = Y = 0."""
    field, count = box.field(), box.velocity.shape[0]
    time = np.arange(count) * box.dt - box.shift
    return time, np.array([field_at(t, 0.0, 0.0, float(hub_height), field) for t in time])


@kernel
def _average(field, hub_height, radius, weight, azimuths, value):
    """Fill value (n_time, 5) with the disk means of u, v, w and the two gradients of u times radius."""
    total = 0.0
    for r in range(radius.shape[0]):
        total += weight[r] * azimuths
    for i in range(value.shape[0]):
        t = i / field.rate - field.shift
        second = 0.0
        for r in range(radius.shape[0]):
            for a in range(azimuths):
                angle = 2.0 * np.pi * (a + 0.5) / azimuths
                y, z = radius[r] * np.cos(angle), radius[r] * np.sin(angle)
                u, v, w = field_at(t, 0.0, y, hub_height + z, field)
                fraction = weight[r] / total
                value[i, 0] += fraction * u
                value[i, 1] += fraction * v
                value[i, 2] += fraction * w
                value[i, 3] += fraction * u * z
                value[i, 4] += fraction * u * y
                second += fraction * z * z
        value[i, 3] /= second
        value[i, 4] /= second


def rotor_average(box, hub_height, rotor_diameter, chord=None):
    """Return (time, value): the box averaged over the rotor disk at X = 0, columns as in WindSeries.

    value (n, 5): means of u, v, w over the area, and the gradients of the plane that fits u best, per rotor
    diameter. chord, (radius, chord) of the blade: each ring counts as chord times radius instead.
    """
    node, weight = np.polynomial.legendre.leggauss(DISK_RADII)
    radius = 0.25 * rotor_diameter * (node + 1.0)
    weight = weight * radius
    if chord is not None:
        weight = weight * np.interp(radius, *chord)
    field = box.field()
    value = np.zeros((box.velocity.shape[0], 5))
    _average(field, float(hub_height), radius, weight, DISK_AZIMUTHS, value)
    value[:, 3:] *= rotor_diameter
    return np.arange(len(value)) * box.dt - box.shift, value
