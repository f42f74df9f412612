"""Lists the loads of the plant: where each is computed and stored, how it is disabled or scaled to zero."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

NOTHING: Mapping[str, Any] = MappingProxyType({})


class LoadFacts(NamedTuple):
    """Holds the facts about a load."""

    summary: str
    file: str  # in fowt_env/plant, implements the equation
    section: str  # of docs/explanation/theory.md
    slot: str | None  # path in plant.model.Model that is None without the load; None: always present
    total: str  # entry of plant.model.LoadCache that includes the load
    without: Mapping[str, Any] = NOTHING  # arguments of build_scene that disable the load
    keys: tuple[str, ...] = ()  # or keys of the platform file, all zero
    strength: tuple[str, ...] = ()  # paths in the model (if present): the load is zero if all are
    mirrored: bool = True  # whether mirrored state and weather give the mirrored load


EXCITATION = (
    *(f"hydro.excitation.first.{name}" for name in ("force", "table.value", "exact.force")),
    *(f"hydro.excitation.second.{name}" for name in ("table.value", "mean")),
)
STRIPS = ("hydro.strips.shape.", "hydro.strips.quadrature.")
LOADS = {
    "weight": LoadFacts(
        "weight of platform, tower, nacelle and rotor",
        "rigid_body.py", "2.4", None, "TOTAL", strength=("rigid_body.gravity",),
    ),
    "buoyancy": LoadFacts(
        "hydrostatic pressure up to the still-water plane, at the present attitude",
        "hydro/hydrostatics.py", "5.3", "hydro", "HYDRO", {"hydrodynamics": False},
        strength=("hydro.hull.specific_weight",),
    ),
    "strips": LoadFacts(
        "Morison's fluid inertia and drag on strips across the hull, and wave pressure on its taper",
        "hydro/morison.py, hydro/wave_bands.py", "5.4", "hydro", "HYDRO", {"hydrodynamics": False},
        strength=tuple(f"{form}density" for form in STRIPS),
    ),
    "keel": LoadFacts(
        "added mass, drag and wave pressure on the keel plate, along the axis",
        "hydro/morison.py, hydro/wave_bands.py", "5.4", "hydro", "HYDRO", {"hydrodynamics": False},
        strength=(
            *(f"{STRIPS[0]}{name}" for name in ("heave_added_mass", "keel_area", "axial_drag_coefficient")),
            *(f"{STRIPS[1]}{name}" for name in ("heave_added_mass", "keel_area", "axial_drag")),
        ),
    ),
    "waves": LoadFacts(
        "motion and pressure of the water at strips and keel; without it the water is still",
        "hydro/waves.py", "5.4", "hydro.waves", "HYDRO", {"sea": None},
        strength=(
            "hydro.waves.amplitude", "hydro.waves.velocity", "hydro.strips.bands.weight", *EXCITATION,
        ),
    ),
    "diffraction": LoadFacts(
        "MacCamy and Fuchs' coefficient of fluid inertia in waves; without it 1 + C_A",
        "hydro/diffraction.py", "5.4", "hydro.strips.diffraction", "HYDRO", {"diffraction": "none"},
    ),
    "current": LoadFacts(
        "steady velocity of the water at the strips",
        "hydro/morison.py", "5.4", "hydro.current", "HYDRO", {"current": None},
        strength=("hydro.current.u", "hydro.current.v"),
    ),
    "linear damping": LoadFacts(
        "additional damping of each motion, and a spring in yaw",
        "hydro/linear_damping.py", "5.6", "hydro.damping", "HYDRO",
        keys=("hydro.linear_damping", "hydro.yaw_stiffness"),
        strength=tuple(
            f"hydro.damping.{name}"
            for name in ("surge", "sway", "heave", "roll", "platform_pitch", "yaw", "yaw_stiffness")
        ),
    ),
    "constant added mass": LoadFacts(
        "added mass of a potential-flow code, with its velocity-dependent terms",
        "hydro/added_inertia.py", "5.6", "hydro.added_inertia", "HYDRO",
        keys=("hydro.added_mass",), strength=("hydro.added_inertia.matrix",),
    ),
    "members": LoadFacts(
        "buoyancy, fluid inertia, wave pressure and drag on cylinders of any position and direction",
        "hydro/members.py, hydro/member_buoyancy.py", "5.10", "hydro.members", "HYDRO", keys=("members",),
        strength=(
            *(f"hydro.members.{name}" for name in ("table", "nodes", "added_mass")),
            "hydro.members.bodies.specific_weight",
        ),
    ),
    "body matrices": LoadFacts(
        "hydrostatics and added mass of a potential-flow body; additional preload, stiffness and damping",
        "hydro/body_matrices.py", "5.7", "hydro.matrices", "HYDRO", keys=("additional",),
        strength=tuple(
            f"hydro.matrices.{name}"
            for name in (
                "preload", "stiffness", "buoyancy", "water_stiffness", "linear_damping", "quadratic_damping",
                "added_mass",
            )
        ),
    ),
    "radiation memory": LoadFacts(
        "force on a potential-flow body from waves radiated by its earlier motion",
        "hydro/radiation.py", "5.8", "hydro.radiation", "HYDRO", {"radiation": "none"},
        strength=("hydro.radiation.weight",),
    ),
    "excitation": LoadFacts(
        "force of the waves on a potential-flow body, first and second order",
        "hydro/excitation.py", "5.9", "hydro.excitation", "HYDRO", keys=("potential_flow",),
        strength=EXCITATION,
    ),
    "moorings": LoadFacts(
        "elastic catenaries on the seabed, quasi-static at the current position; or moving lines",
        "mooring.py, line_dynamics.py", "5.5", "mooring", "MOORING", {"mooring": False},
    ),
    "rotor": LoadFacts(
        "thrust, torque and the other loads of the blades",
        "aero/blade_sweep.py, aero/station_response.py, aero/coefficient_table.py",
        "5.1", "aero", "ROTOR",
        {"wind": None},
        strength=("aero.rotor.elements.air_density", "aero.rotor.density"),
        mirrored=False,  # blades rotate in one direction
    ),
    "tower drag": LoadFacts(
        "drag of the wind on the tower",
        "aero/tower_drag.py", "5.2", "aero.tower", "TOWER", {"tower_drag": False},
        strength=("aero.tower.factor",),
    ),
    "user loads": LoadFacts(
        "user-defined loads, `fowt_env.Load`",
        "user_loads.py", "5.6", "user", "TOTAL", {"loads": ()}, mirrored=False,
    ),
}  # fmt: skip
