"""Parts of the plant's model from the descriptions: rotor, hull, moorings, current."""

from math import cos, radians, sin

import numpy as np

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError, unknown
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.blade_shape import is_curved
from fowt_env.plant.aero.load import Aero, BemRotor
from fowt_env.plant.aero.section_inflow import DynamicSections
from fowt_env.plant.aero.station_choice import build_fewer_elements
from fowt_env.plant.aero.tower_drag import build_tower_drag
from fowt_env.plant.aero.wake import n_wake_states
from fowt_env.plant.blade_pitches import BladePitches
from fowt_env.plant.hydro.added_inertia import build_added_inertia
from fowt_env.plant.hydro.body_matrices import build_body_matrices
from fowt_env.plant.hydro.diffraction import build_strip_diffraction
from fowt_env.plant.hydro.excitation import build_filtered_position
from fowt_env.plant.hydro.hydrostatics import build_hull
from fowt_env.plant.hydro.linear_damping import build_damping
from fowt_env.plant.hydro.load import BandedStrips, ExactStrips, Hydro
from fowt_env.plant.hydro.member_series import N_WATER, VELOCITIES, build_water_series, no_series
from fowt_env.plant.hydro.members import build_members
from fowt_env.plant.hydro.morison import Current
from fowt_env.plant.hydro.strip_quadrature import STILL_REFINEMENT, build_quadrature
from fowt_env.plant.hydro.strips import build_strips
from fowt_env.plant.hydro.wave_bands import build_band_diffraction, build_wave_bands, can_use_bands
from fowt_env.plant.mooring import build_mooring
from fowt_env.plant.state import BLADES, N_RIGID
from fowt_env.plant.tilt import build_tilt
from fowt_env.scene.options import ROTORS, chosen_stations
from fowt_env.scene.radiation_fit import build_radiation
from fowt_env.scene.weather import IN_PLANE
from fowt_env.weather.excitation import build_excitation, still_excitation
from fowt_env.weather.waves import flat_waves, is_flat


def wake_states(aero):
    """Return the number of states of the wake of an Aero part or None."""
    rotor = None if aero is None else aero.rotor
    return n_wake_states(rotor.elements, rotor.wake) if isinstance(rotor, (BemRotor, DynamicSections)) else 0


def build_elements(turbine, density, count):
    """Return the BladeElements of a turbine with that many of its stations; None: all. Raises: InputError."""
    stations = chosen_stations(count, turbine)
    if stations is None or not is_curved(turbine):
        return build_blade_elements(turbine, density, stations)
    return build_fewer_elements(turbine, density, count)


def build_aero(platform, turbine, air, rotor, options):
    """Return the aero part of a scene with wind."""
    density = platform.environment.air_density
    elements = build_elements(turbine, density, options["blade_stations"])
    model = ROTORS[rotor].build(elements, options)
    tower = build_tower_drag(platform.tower, density) if options["tower_drag"] else None
    return Aero(air.series, air.field, model, build_tilt(turbine.rotor.shaft_tilt), tower)


def build_blade_pitches(turbine, rotor, first_state):
    """Return BladePitches of a rotor whose blades have individual pitch, with states from first_state on.

    Raises: InputError for another number of blades, and for a rotor model that knows one pitch alone.
    """
    if turbine.rotor.blades != BLADES:
        raise InputError(
            f"pitch = 'individual': the turbine {turbine.name!r} has {turbine.rotor.blades} blades; allowed"
            f" {BLADES}"
        )
    if not ROTORS[rotor].full_field:
        able = " or ".join(repr(name) for name, model in ROTORS.items() if model.full_field)
        raise InputError(
            f"rotor = {rotor!r}: is a table of the whole rotor at one blade pitch; pitch = 'individual' needs"
            f" rotor = {able}"
        )
    return BladePitches(first_state)


def build_hydro(platform, waves, current, options, dt, first_state=N_RIGID):
    """Hydro part of a scene in water stepped by dt (s); states of waves and memory begin at first_state."""
    site, spar = platform.environment, platform.hull is not None
    strips = None
    if spar:
        shape = _strips(platform, options)
        strips = ExactStrips(shape, None)
        if takes_wave_bands(options, waves, shape):
            quadrature = build_quadrature(platform.hull, shape, _refinement(waves))
            strips = BandedStrips(shape, quadrature, None, None)
    excitation = excitation_in_waves(platform, waves, options, first_state)
    first_state += 0 if excitation is None or excitation.position is None else 2
    return Hydro(
        hull=build_hull(platform.hull, site.water_density, site.gravity) if spar else None,
        strips=strips_in_waves(strips, waves, options),
        waves=waves,
        current=current,
        damping=build_damping(platform.hydro) if spar else None,
        added_inertia=build_added_inertia(platform.hydro.added_mass) if spar else None,
        matrices=build_body_matrices(
            platform.potential_flow, platform.additional, site.water_density, site.gravity
        ),
        radiation=build_radiation(platform.potential_flow, options, dt, first_state),
        members=members_in_waves(_members(platform, options), waves, options),
        excitation=excitation,
        depth=float(site.water_depth),
    )


def hydro_in_waves(hydro, waves, platform, options):
    """Return the hydro of a scene with a sea in other waves (None: still water) of the same types.

    Raises: InputError for a sea beyond the fast path.
    """
    if waves is None:
        waves = _flat_waves_of(platform)
    strips, excitation = hydro.strips, still_excitation(hydro.excitation)
    if not is_flat(waves):
        position = None if excitation is None else excitation.position
        excitation = excitation_in_waves(platform, waves, options, 0 if position is None else position.first)
    if isinstance(strips, BandedStrips) and (is_flat(waves) or is_flat(hydro.waves)):
        nodes = build_quadrature(platform.hull, strips.shape, _refinement(waves))
        quadrature = strips.quadrature._replace(table=nodes.table, keel=nodes.keel)
        strips = strips._replace(quadrature=quadrature)
    return hydro._replace(
        waves=waves,
        strips=strips_in_waves(strips, waves, options),
        members=members_in_waves(hydro.members, waves, options),
        excitation=excitation,
    )


def still_hydro(hydro, platform, options):
    """Hydro of a scene with a sea in flat water: the same types, and nothing of that sea but its strip nodes.

    One component of no height stands for the water, which is summed: a table would only take longer.
    """
    waves = _flat_waves_of(platform)
    members = hydro.members
    return hydro._replace(
        waves=waves,
        strips=strips_in_waves(hydro.strips, waves, options),
        members=None if members is None else members._replace(series=no_series()),
        excitation=still_excitation(hydro.excitation),
    )


def _flat_waves_of(platform):
    site = platform.environment
    return flat_waves(depth=site.water_depth, density=site.water_density, gravity=site.gravity)


def excitation_in_waves(platform, waves, options, first_state):
    """Excitation of a potential-flow body in waves, with states from first_state on; None without either.

    Raises: InputError for a sea beyond the body's coefficients, or second order without a QTF.
    """
    body, second = platform.potential_flow, options["second_order"]
    if second not in (None, "none") and (body is None or body.difference_qtf is None):
        raise InputError(
            f"second_order = {second!r}: the platform {platform.name!r} has no difference-frequency QTF;"
            " allowed without one: None or 'none'"
        )
    position = None
    if options["excitation_position"] == "filtered":
        position = build_filtered_position(first_state, options["excitation_cutoff"])
    return build_excitation(
        body,
        waves,
        position=position,
        duration=options["duration"],
        fast=options["wave_loads"] == "fast",
        planar=options["planar"],
        second_order=second,
        cutoff=options["second_order_cutoff"],
    )


def _refinement(waves):
    """Return how many times as many nodes the strips take as in a sea."""
    return STILL_REFINEMENT if is_flat(waves) else 1


def strips_in_waves(strips, waves, options):
    """Return the strips in waves (None: still water). Raises: InputError for a sea beyond the fast path."""
    if strips is None:
        return None
    diffracting = options["diffraction"] == "maccamy_fuchs" and waves is not None
    if isinstance(strips, ExactStrips):
        return strips._replace(
            diffraction=build_strip_diffraction(waves, strips.shape) if diffracting else None
        )
    bands = wave_bands_of(waves, strips.shape)
    return strips._replace(
        bands=bands, diffraction=build_band_diffraction(bands, strips.quadrature) if diffracting else None
    )


def takes_wave_bands(options, waves, strips):
    """Whether the strip loads take the fast path; where a level asks for it, seas beyond it go exact."""
    if options["wave_loads"] != "fast":
        return False
    if waves is None or can_use_bands(waves, strips):
        return True
    if options["explicit_wave_loads"]:
        raise InputError(
            "wave_loads = 'fast': needs waves of one heading, and surface 'instantaneous' with stretching"
            " 'wheeler' or surface 'swl' with stretching 'none'; use 'exact'"
        )
    return False


def wave_bands_of(waves, strips):
    """WaveBands of the waves, None in still water. Raises: InputError for a sea beyond the fast path."""
    if waves is None:
        return None
    if not can_use_bands(waves, strips):
        raise InputError(
            "sea: several headings cannot be summed fast; use wave_loads = 'exact' from the start"
        )
    return build_wave_bands(waves, strips)


def check_symmetry(lines, current, members=()):
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
    shapes = [_shape_of(member) for member in members]
    for member, shape in zip(members, shapes, strict=True):
        image = shape.copy()
        image[:, 1] *= -1.0
        if not any(
            np.allclose(other, seen, rtol=1e-6, atol=1e-3)
            for other in shapes
            for seen in (image, image[::-1])
        ):
            raise InputError(
                f"member from {list(member.start)} to {list(member.end)} has no mirror image across y = 0; a"
                " planar scene needs one (planar = False)"
            )


def _shape_of(member):
    """Return (2, n) of a Member: what each of its ends has."""
    flow = float(member.potential_flow)
    ends = (member.start, member.end)
    pairs = (value for name, value in member if name not in ("start", "end", "potential_flow"))
    return np.column_stack([ends, *(np.array(pair) for pair in pairs), (flow, flow)])


def _strips(platform, options):
    site = platform.environment
    return build_strips(
        platform.hull,
        platform.hydro,
        density=site.water_density,
        depth=site.water_depth,
        position=options["kinematics_position"],
        surface=options["surface"],
        stretching=options["stretching"],
        cell=options["strip_length"],
    )


def _members(platform, options):
    site = platform.environment
    return build_members(
        platform.members,
        density=site.water_density,
        gravity=site.gravity,
        depth=site.water_depth,
        position=options["kinematics_position"],
        surface=options["surface"],
        stretching=options["stretching"],
        cell=options["strip_length"],
    )


def members_in_waves(members, waves, options):
    """Return members in waves (None: still water), with a table of the water's motion on the fast path."""
    if members is None:
        return None
    still = members.scratch_nodes == 0 and not members.wheeler
    if waves is None or options["wave_loads"] != "fast" or not still:
        return members._replace(series=no_series())
    channels = N_WATER if members.inertial else VELOCITIES
    place = members.nodes[:, :3]
    return members._replace(series=build_water_series(waves, place, channels, options["duration"]))


def build_current(spec):
    """Return the current part, or None where its speed is zero."""
    if spec is None:
        return None
    if not isinstance(spec, dict):
        spec = {"speed": spec}
    for key in spec:
        if key not in ("speed", "heading", "exponent"):
            raise unknown("key of current", key, ("speed", "heading", "exponent"))
    if "speed" not in spec:
        raise InputError("current: the key 'speed' (m/s) is missing")
    speed = check_number("current.speed", spec["speed"], 0.0, 10.0)
    heading = radians(check_number("current.heading", spec.get("heading", 0.0), -360.0, 360.0))
    exponent = check_number("current.exponent", spec.get("exponent", 0.0), 0.0, 10.0)
    if speed == 0.0:
        return None
    return Current(speed * cos(heading), speed * sin(heading), exponent)


def build_moorings(lines, wanted):
    """Return the mooring part, None without lines or where none is required."""
    return build_mooring(lines, tabulated=wanted == "table") if wanted else None
