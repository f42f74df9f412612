"""Builds the rigid bodies of a turbine with elastic parts, and the torsion of its shaft."""

import numpy as np

from fowt_env.errors import InputError
from fowt_env.plant.elastic.shaft import Torsion
from fowt_env.plant.elastic.structure import Structure
from fowt_env.plant.state import BLADES
from fowt_env.scene.mass import assemble, build_lower_body, nacelle_centre


def build_structure(platform, turbine, tower, blades, shaft):
    """Return the Structure of a turbine with TowerModes, BladeModes or a Torsion; None if all are None.

    Raises: InputError for blades with more mass or inertia than the rotor.
    """
    if tower is None and blades is None and shaft is None:
        return None
    rotor, nacelle, drivetrain = turbine.rotor, turbine.nacelle, turbine.drivetrain
    height = 0.0 if tower is None else tower.top_height
    origin = np.array([0.0, 0.0, height])
    above = assemble([(nacelle.mass, np.subtract(nacelle_centre(nacelle), origin), nacelle.inertia)])
    return Structure(
        lower=build_lower_body(platform),
        nacelle_mass=float(nacelle.mass),
        nacelle_moment=np.array([above[1, 5], -above[0, 5], above[0, 4]]),
        nacelle_inertia=np.ascontiguousarray(above[3:, 3:]),
        centre=np.array([-rotor.overhang, 0.0, rotor.hub_height]) - origin,
        tilt_cosine=float(np.cos(rotor.shaft_tilt)),
        tilt_sine=float(np.sin(rotor.shaft_tilt)),
        **_hub(turbine, blades),
        generator_coupling=float(drivetrain.gear_ratio * drivetrain.generator_inertia),
        generator_row=float(drivetrain.gear_ratio**2 * drivetrain.generator_inertia),
    )


def _hub(turbine, blades):
    """Return the hub_* of a Structure: of the rotor, less its BladeModes if they bend."""
    rotor = turbine.rotor
    mass, first, axial = rotor.mass, rotor.mass * rotor.cm_offset, rotor.inertia
    across = rotor.inertia_diameter + rotor.mass * rotor.cm_offset**2
    if blades is not None:
        beam, cosine, sine = blades.beam, blades.cone_cosine, blades.cone_sine
        mass, first = mass - BLADES * beam.mass, first + BLADES * sine * beam.first
        axial = axial - BLADES * cosine**2 * beam.second
        across = across - BLADES * (sine**2 + 0.5 * cosine**2) * beam.second
    for value in (mass, axial):
        if value < 0.0:
            raise InputError(
                f"blades: those of the turbine {turbine.name!r} exceed rotor.mass or rotor.inertia by"
                f" {-value:g} kg or kg m2; check [blade_structure]"
            )
    hub = {"mass": mass, "first": first, "axial": axial, "across": across}
    return {f"hub_{name}": float(value) for name, value in hub.items()}


def build_torsion(turbine, options, first_state):
    """Return the Torsion of option shaft, with states from first_state on; None for "rigid".

    Raises: InputError for a turbine without [shaft_torsion], and in a planar scene.
    """
    if options["shaft"] == "rigid":
        return None
    if turbine.shaft_torsion is None:
        raise InputError(
            f"shaft = {options['shaft']!r}: the turbine {turbine.name!r} has no [shaft_torsion] in its file;"
            " allowed: 'rigid'"
        )
    if options["planar"]:
        raise InputError(
            f"shaft = {options['shaft']!r}: a twisting shaft rolls the nacelle; a planar scene needs 'rigid'"
            " (or planar = False)"
        )
    spring = turbine.shaft_torsion
    return Torsion(int(first_state), float(spring.stiffness), float(spring.damping))
