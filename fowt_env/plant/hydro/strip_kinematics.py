"""Computes water velocity, acceleration and pressure at the strip nodes: the sum over all wave components.

Along the axis a component is exp(kappa z), kappa complex, advanced from node to node by a multiplication. The
seabed's reflection has the same phase and grows downwards, stored as magnitude and direction.
"""

from math import cos, exp, sin
from typing import NamedTuple

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.hydro.diffraction import factor_at
from fowt_env.plant.hydro.strips import GAUSS_GAP, GAUSS_OFFSET, wet_cell
from fowt_env.plant.hydro.waves import NEGLIGIBLE, Kinematics, ramp_factor

EXTINCT = 1e-24  # squared magnitude (1e-12 of the surface value) below which a component is dropped

# rows of the nodes' kinematics
U, V, W, DU, DV, DW, P = range(7)


class Axis(NamedTuple):
    """Holds the hull axis in the waves: inertial origin, direction, and Wheeler stretching of heights."""

    x: float
    y: float
    r13: float
    r23: float
    r33: float
    stretch: float
    base: float  # stretched height of the body origin, m


class Component(NamedTuple):
    """Holds a wave component on the axis: exp(level + up z) at body height z, with phase start + rate z."""

    number: float  # k, 1/m
    omega: float  # rad/s
    velocity: float  # as waves.Waves
    pressure: float  # rho omega / k
    cos_heading: float
    sin_heading: float
    start: float  # rad
    rate: float  # rad per metre of axis
    level: float
    up: float  # 1/m
    mirror: float  # 2 k h: exp(-level - up z - mirror) is the seabed's reflection
    reflected: bool  # whether the reflection reaches the keel


class Phasor(NamedTuple):
    """Holds a wave component at one height: incident wave, magnitude of its reflection, common direction."""

    re: float
    im: float
    reflection: float
    c: float
    s: float


class Step(NamedTuple):
    """Holds the change of a phasor over one cell down: incident factor, growth of reflection, rotation."""

    re: float
    im: float
    growth: float
    c: float
    s: float


@inlined_kernel
def axis_in_waves(pose, eta, strips, depth):
    """Return the Axis at a pose, or upright at the origin where strips have the undisplaced position."""
    stretch, drop = 1.0, 0.0
    if strips.wheeler:
        stretch = depth / (depth + eta)
        drop = stretch * eta
    if strips.instantaneous_position:
        return Axis(pose.x, pose.y, pose.r13, pose.r23, pose.r33, stretch, stretch * pose.z - drop)
    return Axis(0.0, 0.0, 0.0, 0.0, 1.0, stretch, -drop)


@inlined_kernel
def component_on_axis(t, j, axis, keel_z, waves):
    """Return wave Component number j along the axis."""
    k, omega = waves.wave_number[j], waves.omega[j]
    cb, sb = waves.cos_heading[j], waves.sin_heading[j]
    return Component(
        number=k,
        omega=omega,
        velocity=waves.velocity[j],
        pressure=waves.density * omega / k,
        cos_heading=cb,
        sin_heading=sb,
        start=k * (axis.x * cb + axis.y * sb) - omega * t + waves.phase[j],
        rate=k * (axis.r13 * cb + axis.r23 * sb),
        level=k * axis.base,
        up=k * axis.stretch * axis.r33,
        mirror=2.0 * k * waves.depth,
        reflected=2.0 * k * (waves.depth + keel_z) < NEGLIGIBLE,
    )


@inlined_kernel
def reflection_at(wave, z):
    """Return the magnitude of the seabed's reflection at body height z; 0 where it is neglected."""
    return exp(-wave.level - wave.up * z - wave.mirror) if wave.reflected else 0.0


@inlined_kernel
def phasor_at(wave, z):
    """Return the Phasor of a component at body height z."""
    m = exp(wave.level + wave.up * z)
    c, s = cos(wave.start + wave.rate * z), sin(wave.start + wave.rate * z)
    return Phasor(m * c, m * s, reflection_at(wave, z), c, s)


@inlined_kernel
def second_point(wave, first, gap):
    """Return the Phasor of a cell's second Gauss point, a gap (m) below the first."""
    m = exp(-wave.up * gap)
    c, s = cos(wave.rate * gap), -sin(wave.rate * gap)
    reflection = first.reflection * exp(wave.up * gap) if wave.reflected else 0.0
    return Phasor(
        m * (first.re * c - first.im * s), m * (first.re * s + first.im * c), reflection,
        first.c * c - first.s * s, first.c * s + first.s * c,
    )  # fmt: skip


@inlined_kernel
def cell_step(wave, height):
    """Return the phasor Step from a cell to the next, for a cell height (m)."""
    m = exp(-wave.up * height)
    c, s = cos(wave.rate * height), -sin(wave.rate * height)
    return Step(m * c, m * s, exp(wave.up * height) if wave.reflected else 0.0, c, s)


@inlined_kernel
def carried(point, step, reflected):
    """Return the Phasor one cell further down."""
    re, im = point.re * step.re - point.im * step.im, point.re * step.im + point.im * step.re
    if not reflected:
        return Phasor(re, im, 0.0, point.c, point.s)
    return Phasor(
        re, im, point.reflection * step.growth,
        point.c * step.c - point.s * step.s, point.c * step.s + point.s * step.c,
    )  # fmt: skip


@inlined_kernel
def factor_of(diffraction, j, section):
    """Return the diffraction factor (real, imaginary) of a component at a section without taper, or 1."""
    if diffraction is None:
        return 1.0, 0.0
    return factor_at(diffraction.series[j, section], 0.0)


@inlined_kernel
def diffracted(even, odd, even_s, odd_c, diffraction, factor, tapered, j, section, z):
    """Return (sine part of even motion, cosine part of odd motion) of the diffracted acceleration."""
    if diffraction is None:
        return even_s, odd_c
    gr, gi = factor
    if tapered:
        gr, gi = factor_at(diffraction.series[j, section], z - diffraction.centre[section])
    return gr * even_s + gi * even, gr * odd_c - gi * odd


@inlined_kernel
def add_node(kin, node, wave, point, diffraction, factor, tapered, j, section, z):
    """Add a component to a node's kinematics: incident wave plus (even) and minus (odd) its reflection."""
    fr, fi = point.reflection * point.c, point.reflection * point.s
    even_c, even_s = wave.velocity * (point.re + fr), wave.velocity * (point.im + fi)
    odd_c, odd_s = wave.velocity * (point.re - fr), wave.velocity * (point.im - fi)
    kin[U, node] += even_c * wave.cos_heading
    kin[V, node] += even_c * wave.sin_heading
    kin[W, node] += odd_s
    even_a, odd_a = diffracted(even_c, odd_s, even_s, odd_c, diffraction, factor, tapered, j, section, z)
    kin[DU, node] += wave.omega * even_a * wave.cos_heading
    kin[DV, node] += wave.omega * even_a * wave.sin_heading
    kin[DW, node] -= wave.omega * odd_a
    kin[P, node] += wave.pressure * even_c


@inlined_kernel
def add_section(kin, wave, section, z_surf, strips, diffraction, j):
    """Add a component at a section's nodes, downwards. Returns False once the component has decayed."""
    top, height = wet_cell(section, z_surf, strips)
    first = phasor_at(wave, top - GAUSS_OFFSET * height)
    second = second_point(wave, first, GAUSS_GAP * height)
    step = cell_step(wave, height)
    factor, tapered = factor_of(diffraction, j, section), strips.diameter_slope[section] != 0.0
    node = strips.first_node[section]
    for cell in range(strips.cells[section]):
        z = top - height * (cell + GAUSS_OFFSET)
        add_node(kin, node, wave, first, diffraction, factor, tapered, j, section, z)
        z = top - height * (cell + (1.0 - GAUSS_OFFSET))
        add_node(kin, node + 1, wave, second, diffraction, factor, tapered, j, section, z)
        node += 2
        first = carried(first, step, wave.reflected)
        second = carried(second, step, wave.reflected)
        if not wave.reflected and first.re * first.re + first.im * first.im < EXTINCT:
            return False
    return True


@inlined_kernel
def plus_keel(keel, wave, z):
    """Return the keel Kinematics (body height z) with a component added, without diffraction."""
    point = phasor_at(wave, z)
    m = exp(wave.level + wave.up * z)
    even, odd = wave.velocity * (m + point.reflection), wave.velocity * (m - point.reflection)
    return Kinematics(
        keel.u + even * point.c * wave.cos_heading,
        keel.v + even * point.c * wave.sin_heading,
        keel.w + odd * point.s,
        keel.du + wave.omega * even * point.s * wave.cos_heading,
        keel.dv + wave.omega * even * point.s * wave.sin_heading,
        keel.dw - wave.omega * odd * point.c,
        keel.pressure + wave.pressure * even * point.c,
    )


@kernel
def strip_kinematics(t, pose, z_surf, eta, strips, waves, kin, diffraction=None):
    """Fill kin (7, n_nodes) with velocity, acceleration (inertial axes) and dynamic pressure at the nodes.

    z_surf, eta   from strips.axis_surface
    diffraction   StripDiffraction or None; complex factors of the accelerations at the nodes, not the keel
    Returns the Kinematics at the keel.
    """
    kin[:] = 0.0
    keel = Kinematics(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    axis = axis_in_waves(pose, eta, strips, waves.depth)
    for j in range(waves.omega.shape[0]):
        wave = component_on_axis(t, j, axis, strips.keel_z, waves)
        alive, section = True, 0
        while alive and section < strips.cells.shape[0]:
            alive = add_section(kin, wave, section, z_surf, strips, diffraction, j)
            section += 1
        if alive:
            keel = plus_keel(keel, wave, strips.keel_z)
    f = ramp_factor(t, waves.ramp)
    if f != 1.0:
        kin *= f
    return Kinematics(
        f * keel.u, f * keel.v, f * keel.w, f * keel.du, f * keel.dv, f * keel.dw, f * keel.pressure
    )
