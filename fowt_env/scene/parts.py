"""Builds parts of the plant's model from the descriptions: rotor, hull, moorings, current."""

from math import cos, radians, sin, sqrt

import numpy as np

from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.platform import tower_sections
from fowt_env.errors import InputError, unknown
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.blade_shape import is_curved
from fowt_env.plant.aero.load import Aero, BemRotor
from fowt_env.plant.aero.section_inflow import DynamicSections
from fowt_env.plant.aero.station_choice import build_fewer_elements
from fowt_env.plant.aero.tower_drag import build_tower_drag
from fowt_env.plant.aero.tower_influence import build_tower_influence
from fowt_env.plant.aero.unsteady_airfoil import n_airfoil_states
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
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.plant.line_dynamics import build_line_dynamics, line_frequency
from fowt_env.plant.mooring import build_mooring
from fowt_env.plant.state import BLADES, N_RIGID
from fowt_env.plant.tilt import build_tilt
from fowt_env.scene.blade_beam import station_bending
from fowt_env.scene.options import ROTORS, chosen_stations, default_step
from fowt_env.scene.radiation_fit import build_radiation
from fowt_env.scene.tower import nacelle_mobility, tower_frequency
from fowt_env.scene.weather import IN_PLANE
from fowt_env.weather.excitation import build_excitation, still_excitation
from fowt_env.weather.waves import flat_waves, is_flat


def wake_states(aero):
    """Return the number of states of the wake of an Aero part or None."""
    rotor = None if aero is None else aero.rotor
    return n_wake_states(rotor.elements, rotor.wake) if isinstance(rotor, (BemRotor, DynamicSections)) else 0


def airfoil_states(aero):
    """Return the number of states of the unsteady airfoils of an Aero part or None."""
    rotor = None if aero is None else aero.rotor
    return n_airfoil_states(rotor.elements) if isinstance(rotor, (BemRotor, DynamicSections)) else 0


def with_airfoil_step(aero, dt):
    """Return the Aero part with unsteady airfoils for the time step dt (s); unchanged without them."""
    if not airfoil_states(aero):
        return aero
    elements = aero.rotor.elements
    elements = elements._replace(airfoils=elements.airfoils._replace(dt=float(dt)))
    return aero._replace(rotor=aero.rotor._replace(elements=elements))


def build_elements(turbine, density, count, bending=None):
    """Return the BladeElements of a turbine with `count` of its stations; None: all. Raises: InputError.

    bending: of build_blade_elements.
    """
    stations = chosen_stations(count, turbine)
    if stations is None or not (bending or is_curved(turbine)):
        return build_blade_elements(turbine, density, stations, bending=bending)
    return build_fewer_elements(turbine, density, count, bending)


def build_aero(platform, turbine, air, rotor, options):
    """Return the aero part of a scene with wind."""
    density = platform.environment.air_density
    bending = station_bending(turbine, options["blades"])
    elements = build_elements(turbine, density, options["blade_stations"], bending)
    elements = elements._replace(tower=tower_influence_of(platform, turbine, options))
    model = ROTORS[rotor].build(elements, options)
    tower = build_tower_drag(platform.tower, density) if options["tower_drag"] else None
    return Aero(air.series, air.field, model, build_tilt(turbine.rotor.shaft_tilt), tower)


def with_blade_states(aero, blades):
    """Return an Aero or None with the index of the first state of BladeModes (None: unchanged)."""
    if aero is None or blades is None:
        return aero
    elements = aero.rotor.elements
    elements = elements._replace(modes=elements.modes._replace(first=blades.first))
    return aero._replace(rotor=aero.rotor._replace(elements=elements))


def tower_influence_of(platform, turbine, options):
    """Return the TowerInfluence of a scene, None without one."""
    models = options["tower_potential"], options["tower_shadow"]
    return build_tower_influence(tower_sections(platform.tower), *models, turbine.rotor)


def build_blade_pitches(turbine, rotor, first_state):
    """Return BladePitches of a rotor whose blades have individual pitch, with states from first_state on.

    Raises: InputError for another number of blades, and for a rotor model with one pitch only.
    """
    if turbine.rotor.blades != BLADES:
        raise InputError(
            f"pitch = 'individual': the turbine {turbine.name!r} has {turbine.rotor.blades} blades; allowed"
            f" {BLADES}"
        )
    if not ROTORS[rotor].full_field:
        able = " or ".join(repr(name) for name, model in ROTORS.items() if model.full_field)
        raise InputError(
            f"rotor = {rotor!r}: tabulates the whole rotor at one blade pitch; pitch = 'individual' needs"
            f" rotor = {able}"
        )
    return BladePitches(first_state)


def build_hydro(platform, waves, current, options, dt, first_state=N_RIGID):
    """Return the Hydro of a scene with time step dt (s); states of waves and memory start at first_state."""
    site, spar, kinematics = platform.environment, platform.hull is not None, _kinematics(platform, options)
    strips, water = None, (site.water_density, site.gravity)
    if spar:
        shape = build_strips(platform.hull, platform.hydro, **kinematics)
        strips = ExactStrips(shape, None)
        if takes_wave_bands(options, waves, shape):
            quadrature = build_quadrature(platform.hull, shape, _refinement(waves))
            strips = BandedStrips(shape, quadrature, None, None)
    excitation = excitation_in_waves(platform, waves, options, first_state)
    first_state += 0 if excitation is None or excitation.position is None else 2
    members = build_members(platform.members, gravity=site.gravity, **kinematics)
    return Hydro(
        hull=build_hull(platform.hull, *water) if spar else None,
        strips=strips_in_waves(strips, waves, options),
        waves=waves,
        current=current,
        damping=build_damping(platform.hydro) if spar else None,
        added_inertia=build_added_inertia(platform.hydro.added_mass) if spar else None,
        matrices=build_body_matrices(platform.potential_flow, platform.additional, *water),
        radiation=build_radiation(platform.potential_flow, options, dt, first_state),
        members=members_in_waves(members, waves, options),
        excitation=excitation,
        depth=float(site.water_depth),
    )


def hydro_in_waves(hydro, waves, platform, options):
    """Return the Hydro of a scene with other waves (None: still water), with parts of the same types.

    Raises: InputError for a sea that the fast path does not support.
    """
    waves = _flat_waves_of(platform) if waves is None else waves
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
    """Return the Hydro of a scene with flat water, with parts of the same types and the same strip nodes.

    Flat water is one wave component of zero height; the sum is faster than a table.
    """
    waves = _flat_waves_of(platform)
    return hydro._replace(
        waves=waves,
        strips=strips_in_waves(hydro.strips, waves, options),
        members=members_in_waves(hydro.members, None, options),
        excitation=still_excitation(hydro.excitation),
    )


def _flat_waves_of(platform):
    site = platform.environment
    return flat_waves(depth=site.water_depth, density=site.water_density, gravity=site.gravity)


def excitation_in_waves(platform, waves, options, first_state):
    """Return the Excitation of a potential-flow body in waves, with states from first_state; None without.

    Raises: InputError for a sea outside the range of coefficients, or second order without a QTF.
    """
    body, second = platform.potential_flow, options["second_order"]
    if second not in (None, "none") and (body is None or body.difference_qtf is None):
        raise InputError(
            f"second_order = {second!r}: the platform {platform.name!r} has no difference-frequency QTF;"
            " allowed without one: None or 'none'"
        )
    if second == "full_sum" and body.sum_qtf is None:
        raise InputError(
            f"second_order = 'full_sum': the platform {platform.name!r} has no sum-frequency QTF (WAMIT's"
            " .12s); allowed without one: None, 'none', 'mean_drift', 'newman' or 'full'"
        )
    position = None
    if options["excitation_position"] == "filtered":
        position = build_filtered_position(first_state, options["excitation_cutoff"])
    settings = {name: options[name] for name in ("duration", "planar", "second_order")}
    settings |= {"fast": options["wave_loads"] == "fast", "cutoff": options["second_order_cutoff"]}
    return build_excitation(body, waves, position=position, **settings)


def _refinement(waves):
    """Return the factor on the number of strip nodes, higher in still water."""
    return STILL_REFINEMENT if is_flat(waves) else 1


def strips_in_waves(strips, waves, options):
    """Return the strips in waves (None: still water). Raises: InputError if the fast path lacks the sea."""
    if strips is None:
        return None
    diffracting = options["diffraction"] == "maccamy_fuchs" and waves is not None
    if isinstance(strips, ExactStrips):
        part = build_strip_diffraction(waves, strips.shape) if diffracting else None
        return strips._replace(diffraction=part)
    if waves is not None and not can_use_bands(waves, strips.shape):
        raise InputError(
            "sea: several headings cannot be summed fast; use wave_loads = 'exact' from the start"
        )
    bands = None if waves is None else build_wave_bands(waves, strips.shape)
    part = build_band_diffraction(bands, strips.quadrature) if diffracting else None
    return strips._replace(bands=bands, diffraction=part)


def takes_wave_bands(options, waves, strips):
    """Return whether strip loads use the fast path; a fidelity falls back to exact loads for other seas."""
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


def check_symmetry(lines, current, members=()):
    """Check the symmetry of lines, current and members of a planar scene. Raises: InputError."""
    if current is not None and abs(current.v) > IN_PLANE * abs(current.u):
        raise InputError("current.heading: must be 0 or 180 deg in a planar scene")
    mirror = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    keys = ("length", "wet_weight", "EA", "seabed_friction")
    rows = [np.array([*line.anchor, *line.fairlead, *(getattr(line, key) for key in keys)]) for line in lines]
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
        ways = (image, image[::-1])
        if not any(np.allclose(other, way, rtol=1e-6, atol=1e-3) for other in shapes for way in ways):
            raise InputError(
                f"member from {list(member.start)} to {list(member.end)} has no mirror image across y = 0; a"
                " planar scene needs one (planar = False)"
            )


def _shape_of(member):
    """Return the (2, n) properties at both ends of a Member."""
    pairs = [np.array(value) for name, value in member if name not in ("start", "end", "potential_flow")]
    return np.column_stack([(member.start, member.end), *pairs, 2 * (float(member.potential_flow),)])


def _kinematics(platform, options):
    """Return the common keywords of strips and members: site and wave kinematics."""
    site = platform.environment
    return {
        "density": site.water_density, "depth": site.water_depth, "position": options["kinematics_position"],
        "surface": options["surface"], "stretching": options["stretching"], "cell": options["strip_length"],
        "axis": options["strip_axis"],
    }  # fmt: skip


def members_in_waves(members, waves, options):
    """Return members in waves (None: still water), with a table of the water's motion on the fast path."""
    if members is None:
        return None
    still = members.scratch_nodes == 0 and not members.wheeler
    if waves is None or options["wave_loads"] != "fast" or not still:
        return members._replace(series=no_series())
    channels = N_WATER if members.inertial else VELOCITIES
    position = members.nodes[:, :3]
    return members._replace(series=build_water_series(waves, position, channels, options["duration"]))


def build_current(spec):
    """Return the Current part, None for zero speed. Raises: InputError."""
    if spec is None:
        return None
    spec = spec if isinstance(spec, dict) else {"speed": spec}
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


def build_moorings(platform, options):
    """Return the mooring part for the options mooring and line_segments, None without lines or with False.

    Moving lines have states from 0 on: line_dynamics.first is to be set. Raises: InputError for moving lines
    without properties, and for a number of segments of lines that do not move.
    """
    option, segments = options["mooring"], options["line_segments"]
    if segments is not None and option != "dynamic":
        raise InputError(f"line_segments = {segments}: needs mooring = 'dynamic', not {option!r}")
    if not option:
        return None
    mooring = build_mooring(platform.lines, tabulated=option == "table")
    if mooring is None or option != "dynamic":
        return mooring
    own = [line.dynamics or platform.line_dynamics for line in platform.lines]
    if None in own:
        raise InputError(
            f"mooring = 'dynamic': the file of the platform {platform.name!r} has no [line_dynamics]"
            f" (diameter, drag, added mass) for line {own.index(None) + 1}; allowed without it: True, False,"
            " 'catenary' or 'table'"
        )
    if segments is not None:
        own = [part.model_copy(update={"segments": segments}) for part in own]
    site = platform.environment
    fluid = site.water_density, site.gravity, site.water_depth
    dynamics = build_line_dynamics(platform.lines, own, *fluid)
    # moving lines have no friction on the bed, and their states of rest none either
    return mooring._replace(dynamics=dynamics, friction=np.zeros_like(mooring.friction))


def step_of(options, tower, mooring, body, structure, turbine):
    """Return the default physics step (s) of a scene with these parts."""
    fastest = fastest_motion(options, tower, mooring, body, structure)
    return default_step(options, fastest, nacelle_swing(options, tower, body, structure, turbine))


def fastest_motion(options, tower, mooring, body, structure):
    """Return the largest natural frequency (rad/s) that steps resolve: of the tower, or on moving lines."""
    share = 1.0
    if INTEGRATORS[options["integrator"]].swings:
        # exact, but coupled by extrapolation to a shaft that twists: stable up to the limit itself, twice
        # what a default step is allowed
        share = 0.0 if options["shaft"] == "rigid" else 0.5
    return max(share * tower_frequency(tower, body, structure), line_frequency(mooring, body.mass))


def nacelle_swing(options, tower, body, structure, turbine):
    """Return sqrt(k m), rad/s, of the stiffness of a shaft and the mobility of the nacelle by its torque.

    By so much the nacelle speeds up blades that bend in phase on the shaft, which steps advance as beside a
    nacelle at rest. 0 where they do not. The nacelle feels what the gearbox does not pass on.
    """
    if "rigid" in (options["blades"], options["shaft"]) or not INTEGRATORS[options["integrator"]].swings:
        return 0.0
    mobility = nacelle_mobility(tower, body, structure, turbine)
    return (1.0 - 1.0 / turbine.drivetrain.gear_ratio) * sqrt(turbine.shaft_torsion.stiffness * mobility)
