"""Describes nacelle lidars: beam directions, range weighting and scan period; built-in or from a file."""

from typing import Annotated

from pydantic import Field

from fowt_env.caches import cached
from fowt_env.descriptions.files import DATA, locate, read_toml
from fowt_env.descriptions.records import Record, bounded, checked_entries, checked_record

Angle = bounded(gt=-60.0, lt=60.0)  # deg
Distance = bounded(ge=10.0, le=1000.0)  # m


class Lidar(Record):
    """Describes a lidar on the nacelle that looks upwind; keys and units as in data/lidars.toml.

    Either azimuth and elevation of each beam, or beams and half_angle; either pulse_length, or lens_radius
    and wavelength; without these the lidar measures at points.
    """

    name: str = ""
    azimuth: tuple[Angle, ...] = ()  # deg to the left, looking upwind from above: towards +y
    elevation: tuple[Angle, ...] = ()  # deg upwards
    beams: Annotated[int, Field(strict=True, ge=1, le=1000)] | None = None
    half_angle: bounded(gt=0.0, lt=60.0) | None = None  # deg
    distances: tuple[Distance, ...]  # m from the lidar along the wind, increasing
    pulse_length: bounded(gt=0.0, le=500.0) | None = None  # m
    lens_radius: bounded(ge=1e-3, le=1.0) | None = None  # m
    wavelength: bounded(ge=1e-7, le=1e-4) | None = None  # m
    scan_period: bounded(ge=0.0, le=60.0) = 0.0  # s per scan, in which every beam measures once
    behind_rotor: bounded(ge=0.0, le=100.0) | None = None  # m downwind of the rotor plane; None: unobstructed
    above_shaft: bounded(gt=-50.0, lt=50.0) = 0.0  # m
    source: str = ""
    confidence: str = ""

    def _problems(self):
        cone = (self.beams is not None) + (self.half_angle is not None)
        if cone == 1 or (cone == 2) == bool(self.azimuth) or len(self.azimuth) != len(self.elevation):
            yield "needs azimuth and elevation, equally long, or else beams and half_angle"
        optics = (self.lens_radius is not None) + (self.wavelength is not None)
        if optics == 1 or (optics == 2 and self.pulse_length is not None):
            yield "needs pulse_length, or else lens_radius and wavelength, or none of these"
        pairs = zip(self.distances[:-1], self.distances[1:], strict=True)
        if not self.distances or any(far <= near for near, far in pairs):
            yield f"distances = {self.distances}: must be at least one, increasing, m"


@cached(1)
def lidars():
    """Return {name: Lidar} of the built-in lidars."""
    return checked_entries(Lidar, DATA / "lidars.toml", "lidar", "lidar")


def read_lidar(lidar):
    """Return the Lidar of a built-in name (lidars()) or a TOML file with top-level keys; a Lidar unchanged.

    Raises: InputError naming the key, value and allowed range.
    """
    if isinstance(lidar, Lidar):
        return lidar
    if isinstance(lidar, str) and lidar in lidars():
        return lidars()[lidar]
    path = locate("lidar", lidar, lidars())
    data = {"name": path.stem, **read_toml(path, "lidar")}
    return checked_record(Lidar, data, f"lidar file {str(path)!r}")
