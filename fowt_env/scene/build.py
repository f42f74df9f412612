"""Builds a scene from descriptions: checks, types and assembles all parts of a run once."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fowt_env.descriptions.checks import check_whole_number
from fowt_env.descriptions.platform import Platform, read_platform
from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.descriptions.turbine import Turbine, read_turbine, with_second_order_drive
from fowt_env.plant.drivetrain import build_drivetrain, build_torque_limits
from fowt_env.plant.hydro.excitation import position_states
from fowt_env.plant.hydro.radiation import memory_states
from fowt_env.plant.integrators import build_integrator
from fowt_env.plant.model import Model
from fowt_env.plant.state import BLADES, N_RIGID
from fowt_env.scene.actuators import build_actuator, build_converter, drive_states
from fowt_env.scene.blade_beam import blade_states, build_blade_modes
from fowt_env.scene.geometry import warn_of_geometry
from fowt_env.scene.mass import build_layout, build_rigid_body
from fowt_env.scene.options import checked_options, choose_parts, samples_per_step
from fowt_env.scene.parts import (
    airfoil_states,
    build_aero,
    build_blade_pitches,
    build_current,
    build_hydro,
    build_moorings,
    check_symmetry,
    step_of,
    wake_states,
    with_airfoil_step,
    with_blade_states,
)
from fowt_env.scene.plausibility import warn_of_weather
from fowt_env.scene.scene import Scene
from fowt_env.scene.structure import build_structure, build_torsion
from fowt_env.scene.tower import build_tower_modes, modes_asked, tower_states
from fowt_env.scene.user_loads import Load, build_user_loads, checked_loads
from fowt_env.scene.weather import Sea, Wind, build_weather
from fowt_env.shipped import take_kernels


def build_scene(
    platform: str | Path | Platform = "oc3_hywind",
    wind: Wind = None,
    sea: Sea = None,
    *,
    seed: int = 0,
    rotor: str | None = None,
    fidelity: str = "standard",
    loads: Sequence[Load] = (),
    **options: Any,
) -> Scene:
    """Return the scene of a platform, a wind and a sea.

    platform  built-in name, path to a TOML file, or a descriptions.platform.Platform
    wind      None: no aerodynamics; 0.0: still air; a speed (m/s); "ntm:18:B" (KIND:SPEED:CLASS); a path to a
              box of TurbSim (.bts), a uniform wind file (.wnd, .hh) or a table of time and speed (.csv,
              .parquet); or a dict with "kind": steady, series, steps, eog, edc, ecd, ews, ewm, ntm, etm
              (weather/wind.py), or a box of full-field wind: bts, box, mann (weather/wind_field.py),
              rotor-averaged for rotor "table"
    sea       None: still water; a named sea state (`fowt list seas`); "jonswap:4:9" (Hs, Tp), "regular:3:5"
              (H, T); a path to a TOML file; or a dict with "kind": regular, jonswap, pierson_moskowitz,
              components
    seed      of all random processes: equal seeds give bit-identical results
    rotor     "bem": blade-element momentum solved at every blade and station; "lookup": the same sweep
              from a table per station; "table": the whole rotor as one table. None: that of the fidelity
    fidelity  "standard": every blade and station by look-up, fast wave sums, Adams-Bashforth 4 (in a box of
              wind with three rotor loads per step), within 1e-3 of "reference" and a thousand times faster;
              "reference": everything solved exactly, Runge-Kutta 4, some 20 times real time; "elastic":
              "standard" with bending blades and tower, torsion of the shaft and dynamic inflow, for which the
              files must have data; "fast": the rotor as one table. An explicit option overrides a part
    loads     additional user-defined loads on platform and tower (fowt_env.Load)
    options   see OPTIONS; a platform file may set other defaults. planar: only surge, heave and platform
              pitch move; ntm and etm turbulence is reduced to its components in the plane

    Raises: InputError naming the key, the value and what is allowed. Warns (PlantWarning), once, of
    implausible positions of the platform (details: `fowt model check`), of waves above the breaking limit,
    and of a mean wind in which the turbine does not operate.
    """
    take_kernels()
    label = platform.name if isinstance(platform, Platform) else str(platform)
    if not isinstance(platform, Platform):
        platform = read_platform(platform)
    options = checked_options(options, platform)
    turbine = options["turbine"] or platform.turbine
    if not isinstance(turbine, Turbine):
        turbine = read_turbine(turbine)
    if options["pitch_drive"] == "second_order":
        turbine = with_second_order_drive(turbine)
    rotor = choose_parts(fidelity, rotor, options)
    seed = check_whole_number("seed", seed, 0)
    warn_of_geometry(platform, label)
    air, waves = build_weather(wind, sea, seed, platform, turbine, rotor, options)
    warn_of_weather(air, sea_state_of(sea), platform, turbine, label)
    current = build_current(options["current"]) if options["hydrodynamics"] else None
    if options["planar"]:
        members = platform.members if options["hydrodynamics"] else ()
        check_symmetry(platform.lines if options["mooring"] else (), current, members)
    mooring = build_moorings(platform, options)
    user = checked_loads(loads, 0 if mooring is None else mooring.length.shape[0], options["planar"])
    aero = None if air.series is None else build_aero(platform, turbine, air, rotor, options)
    first_state = N_RIGID + wake_states(aero) + airfoil_states(aero)
    next_state = first_state + sum(load.states for load in user)
    tower = build_tower_modes(platform, turbine, modes_asked(options), next_state)
    next_state += tower_states(tower)
    blades = build_blade_modes(turbine, options, next_state, aero)
    next_state += blade_states(blades)
    shaft = build_torsion(turbine, options, next_state)
    next_state += 0 if shaft is None else 2
    body = build_rigid_body(platform, turbine, plane=True if options["planar"] else None)
    structure = build_structure(platform, turbine, tower, blades, shaft)
    dt = step_of(options, tower, mooring, body, structure, turbine)
    aero = with_airfoil_step(aero, dt)
    pitches = None
    if options["pitch"] == "individual":
        pitches = build_blade_pitches(turbine, rotor, next_state)
        next_state += BLADES - 1
    actuator = build_actuator(turbine.pitch_drive, next_state, 1 if pitches is None else BLADES)
    next_state += sum(drive_states(actuator, pitches).values())
    converter = build_converter(turbine.drivetrain, next_state)
    next_state += 0 if converter is None else 1
    hydro = None
    if options["hydrodynamics"]:
        hydro = build_hydro(platform, waves, current, options, dt, next_state)
        next_state += position_states(hydro) + memory_states(hydro)
    if mooring is not None and mooring.dynamics is not None:
        mooring = mooring._replace(dynamics=mooring.dynamics._replace(first=next_state))
    model = Model(
        rigid_body=body,
        layout=build_layout(platform, turbine, pitches is not None, structure is not None),
        drivetrain=build_drivetrain(turbine),
        actuator=actuator,
        generator=build_torque_limits(turbine.torque_law),
        hydro=hydro,
        mooring=mooring,
        aero=with_blade_states(aero, blades),
        integrator=build_integrator(options["integrator"], samples_per_step(options, air.field)),
        user=build_user_loads(user, platform.tower.base_height, first_state),
        pitches=pitches,
        converter=converter,
        tower=tower,
        blades=blades,
        shaft=shaft,
        structure=structure,
    )
    return Scene(model, platform, turbine, air.spec, sea, seed, rotor, options, air.speed, user, label)
