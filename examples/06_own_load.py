"""A load of your own, compiled into the plant: a heave plate under the keel.

A load is a small function that numba compiles, a few numbers, and the point of the platform where it acts.
The function reads what it needs from `motion` (fowt_env.Motion lists it: where the point is, how it moves,
wind, water, time) and writes a force and a moment into `force`. It then is a part of the plant like any
other: trims, linear models, environments and runs have it, and its force is a channel of the output.

The plate is a disk of 20 m: water dragged along with it brakes the heave. Its drag is quadratic in the
velocity relative to the water, which moves too (water=True). The water that the plate carries with it would
be added mass: that belongs into the platform file (hydro.heave_added_mass).
"""

from math import pi
from typing import NamedTuple

from fowt_env import Load, Motion, build_scene, load_kernel, simulate


class Plate(NamedTuple):
    """What the kernel is given, in this order."""

    factor: float  # 1/2 water density x drag coefficient x area, kg/m


@load_kernel
def plate_drag(parameters, motion, force):
    """Drag along the axis of the spar: the axes are those of the body."""
    speed = motion[Motion.WATER_Z] - motion[Motion.VZ]
    force[2] = parameters[0] * abs(speed) * speed


DIAMETER, DRAG_COEFFICIENT, KEEL = 20.0, 4.0, -120.0  # m, of a thin disk at small strokes, m
plate = Load(
    "Plate",
    plate_drag,
    Plate(0.5 * 1025.0 * DRAG_COEFFICIENT * 0.25 * pi * DIAMETER**2),
    point=(0.0, 0.0, KEEL),
    axes="body",
    water=True,
)

if __name__ == "__main__":
    still = {"fidelity": "standard"}
    swell = {"fidelity": "standard", "sea": {"kind": "jonswap", "Hs": 6.0, "Tp": 14.0}}
    for name, loads in (("bare spar", ()), ("with plate", (plate,))):
        decay = simulate(
            build_scene(loads=loads, **still), None, 120.0, initial={"start": "zero", "PtfmHeave": 4.0}
        )
        heave = decay["PtfmHeave_[m]"]
        waves = simulate(build_scene(loads=loads, **swell), None, 300.0)
        print(
            f"{name:10}  heave from 4 m, after 90 to 120 s up to {heave.iloc[-300:].abs().max():.2f} m;"
            f"  in swell std {waves['PtfmHeave_[m]'].std():.3f} m"
        )
    print(f"largest force of the plate in swell: {waves['PlateFzi_[N]'].abs().max() / 1e3:.0f} kN")
