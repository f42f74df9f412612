"""Floaters for tests: a tension-leg platform, a semi, a spar of members, OC3-Hywind with a value changed."""

import re
from math import pi

from fowt_env.descriptions.files import DATA
from fowt_env.descriptions.platform import Ballast, Environment, Line, Member, Platform, read_platform

TENDON = (151.73, 1010.5, 1.5e9)  # unstretched length m, weight in water N/m, EA N


def tendons():
    """The eight tendons of the MIT/NREL TLP in OpenFAST's regression tests, two at each fairlead."""
    places = [(27.0, 0.0), (0.0, 27.0), (-27.0, 0.0), (0.0, -27.0)]
    length, weight, stiffness = TENDON
    return tuple(
        Line(anchor=(x, y, -200.0), fairlead=(x, y, -47.89), length=length, wet_weight=weight, EA=stiffness)
        for x, y in places
        for _ in range(2)
    )


def tension_leg():
    """The MIT/NREL TLP of that test with its hull as one member."""
    hull = Member(
        start=(0.0, 0.0, -47.89), end=(0.0, 0.0, 10.0), diameter=(18.0, 18.0), drag_coefficient=(0.6, 0.6),
        added_mass_coefficient=(1.0, 1.0), axial_added_mass_coefficient=(1.0, 0.0),
    )  # fmt: skip
    return Platform(
        name="tension leg",
        turbine="nrel5mw",
        environment=Environment(water_depth=200.0),
        ballast=Ballast(mass=8600410.0, cm_depth=40.612, inertia=(571624000.0, 571624000.0, 361408000.0)),
        tower=read_platform("oc3_hywind").tower,
        members=(hull,),
        lines=tendons(),
    )


def spar_members(platform):
    """OC3-Hywind's hull with the coefficients of its strips as members, keel first."""
    hull, hydro = platform.hull, platform.hydro
    half_sphere = platform.environment.water_density * 2.0 / 3.0 * pi * (0.5 * hull.diameter[0]) ** 3
    sections = zip(hull.z[:-1], hull.z[1:], hull.diameter[:-1], hull.diameter[1:], strict=True)
    return tuple(
        Member(
            start=(0.0, 0.0, low), end=(0.0, 0.0, high), diameter=(a, b),
            drag_coefficient=(hydro.drag_coefficient,) * 2,
            added_mass_coefficient=(hydro.added_mass_coefficient,) * 2,
            axial_added_mass_coefficient=(hydro.heave_added_mass / half_sphere if n == 0 else 0.0, 0.0),
        )
        for n, (low, high, a, b) in enumerate(sections)
    )  # fmt: skip


def spar(**change):
    """OC3-Hywind with its hull as members."""
    platform = read_platform("oc3_hywind")
    fields = {name: value for name, value in platform if name not in ("hull", "hydro", "members")}
    return Platform(**fields | {"name": "spar", "members": spar_members(platform)} | change)


def semi(**change):
    """Three columns of 12 m on pontoons with a thin one under the tower, 20 m deep, afloat by its volume."""
    corners = ((14.4, 25.0), (-28.8, 0.0), (14.4, -25.0))
    column = {"drag_coefficient": (0.6, 0.6), "added_mass_coefficient": (0.8, 0.8)}
    members = [
        Member(
            start=(x, y, -20.0), end=(x, y, 12.0), diameter=(12.0, 12.0),
            axial_drag_coefficient=(4.8, 0.0), axial_added_mass_coefficient=(1.0, 0.0), **column,
        )
        for x, y in corners
    ]  # fmt: skip
    members.append(Member(start=(0.0, 0.0, -20.0), end=(0.0, 0.0, 10.0), diameter=(6.5, 6.5), **column))
    members += [
        Member(start=(x, y, -17.0), end=(0.0, 0.0, -17.0), diameter=(3.0, 3.0), **column) for x, y in corners
    ]
    volume = 3 * 36.0 * pi * 20.0 + 3.25**2 * pi * 20.0 + sum(2.25 * pi * 28.8 for _ in corners)
    lines = tuple(
        Line(
            anchor=(837.0 * x / 28.85, 837.0 * y / 28.85, -200.0), fairlead=(x, y, -14.0), length=840.0,
            wet_weight=1065.0, EA=753.6e6,
        )
        for x, y in corners
    )  # fmt: skip
    fields = {
        "name": "semi",
        "turbine": "nrel5mw",
        "environment": Environment(water_depth=200.0),
        "ballast": Ballast(mass=1025.0 * volume - 600e3 - 190e3, cm_depth=14.0, inertia=(4e9, 4e9, 6e9)),
        "tower": read_platform("oc3_hywind").tower,
        "members": tuple(members),
        "lines": lines,
    }
    return Platform(**fields | change)


def edited(folder, key, value):
    """Path of a copy of the OC3-Hywind file in which the first line of that key has another value."""
    text = (DATA / "platforms" / "oc3_hywind.toml").read_text()
    path = folder / "mine.toml"
    path.write_text(re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", text, count=1))
    return path
