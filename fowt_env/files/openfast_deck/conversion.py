"""From a deck to the figures of this project's platform and turbine files, each with its source.

A table of a file is a list of Row; a value is a number, a list, or a text. Nothing is written here.
"""

import math
from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.rotor_mass import rotor_mass_properties
from fowt_env.descriptions.units import RPM
from fowt_env.files.openfast_deck.hydrodyn import is_old
from fowt_env.files.openfast_deck.rosco_files import DISCON

NEAR = 0.05  # m, of the outermost blade stations from hub and tip: line loads fall to zero there
OVERSPEED = 1.3  # of the rated speed: failure threshold of the environment, a choice of this project
DEFAULT_SHEAR = 0.14


class Row(NamedTuple):
    """A line of a text file."""

    key: str
    value: object
    comment: str = ""


def mass_properties(deck):
    """{name: figure} of the parts and their sum, kg and m: what ElastoDyn's summary lists too."""
    values = deck.elastodyn
    blade = float(values.blade.mass.sum())
    rotor = values["HubMass"] + values.blades * blade
    water = sum(fill.mass for fill in deck.hydrodyn.fills)
    top = rotor + values["NacMass"] + values["YawBrMass"]
    return {
        "blade": blade,
        "rotor": rotor,
        "nacelle": values["NacMass"],
        "yaw bearing": values["YawBrMass"],
        "tower top": top,
        "tower": deck.elastodyn.tower.mass,
        "platform": values["PtfmMass"],
        "ballast water": water,
        "total": top + deck.elastodyn.tower.mass + values["PtfmMass"] + water,
    }


def rotor_mass(deck):
    """RotorMass of straight blades along the coned pitch axis, as ElastoDyn has them."""
    values = deck.elastodyn
    if values["HubMass"] + values.blade.mass.sum() <= 0.0:
        raise values.file.wrong("HubMass", values["HubMass"], "> 0 with massless blades")
    return rotor_mass_properties(
        values.blade,
        blades=values.blades,
        cone=-values["PreCone"],
        hub_mass=values["HubMass"],
        hub_inertia=values["HubIner"],
        hub_cm=values["HubCM"],
    )


def ballast(deck):
    """(mass, centre (3,), inertia tensor (3, 3) about it) of the platform with the water in its members."""
    values = deck.elastodyn
    xy, yz, xz = values.platform_products
    inertia = np.array([
        [values["PtfmRIner"], xy, xz],
        [xy, values["PtfmPIner"], yz],
        [xz, yz, values["PtfmYIner"]],
    ])  # fmt: skip
    place = np.array([values["PtfmCMxt"], values["PtfmCMyt"], values["PtfmCMzt"]])
    bodies = [(values["PtfmMass"], place, inertia)]
    bodies += [(fill.mass, np.array(fill.centre), fill.inertia) for fill in deck.hydrodyn.fills]
    mass = sum(body[0] for body in bodies)
    if mass <= 0.0:
        raise values.file.wrong("PtfmMass", values["PtfmMass"], "> 0: a floating platform")
    centre = sum(body[0] * body[1] for body in bodies) / mass
    total = np.zeros((3, 3))
    for part, at, own in bodies:
        d = at - centre
        total += own + part * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, centre, total


def additional_stiffness(deck):
    """((6, 6) stiffness, comment): AddCLin, less what the weight of water in members has by itself.

    Of old files alone (hydrodyn.is_old); in all others the weight moves with the members.
    """
    hydro, source = deck.hydrodyn, deck.hydrodyn.file.source("AddCLin")
    stiffness = np.array(hydro.stiffness)
    if not hydro.fills or not is_old(hydro.file):
        return stiffness, source
    own = np.zeros((6, 6))
    for fill in hydro.fills:
        x, y, z = np.array(fill.centre) * fill.mass * deck.site.gravity
        own[3, 3] -= z
        own[4, 4] -= z
        own[3, 5] += x
        own[4, 5] += y
    rest = stiffness - own
    rest[np.abs(rest) < 1e-6 * np.abs(own).max()] = 0.0
    return rest, f"{source}, less what the weight of the water in members restores"


def tower_mass(deck):
    """(mass, height of its centre, inertia across) of the tower with the yaw bearing, a point at its top."""
    values, span = deck.elastodyn, deck.elastodyn.tower
    base, extra = values["TowerBsHt"], values["YawBrMass"]
    mass = span.mass + extra
    first = span.first + extra * span.length
    second = span.second + extra * span.length**2
    centre = first / mass if mass else 0.5 * span.length
    return mass, base + centre, max(second - mass * centre**2, 0.0)


def hub_place(deck):
    """(overhang, hub height): the rotor centre upwind of the tower axis and above still water, m."""
    values = deck.elastodyn
    tilt = values["ShftTilt"]
    return (
        -values["OverHang"] * math.cos(tilt),
        values["TowerHt"] + values["Twr2Shft"] + values["OverHang"] * math.sin(tilt),
    )


def stations(deck):
    """(n, 5) radius, chord, twist (deg), prebend, sweep and the airfoils of the blade."""
    aero, values = deck.aerodyn, deck.elastodyn
    hub, tip = values["HubRad"], values["TipRad"]
    radius = hub + aero.span
    if radius[-1] > tip * 1.005:
        raise aero.blade_file.refusal(
            f"BlSpn ends at {aero.span[-1]:g} m: must be within TipRad - HubRad = {tip - hub:g} m"
        )
    radius = np.clip(radius, hub + NEAR, tip - NEAR)
    keep = np.concatenate([[True], np.diff(radius) > 1e-6])
    if not keep[-1]:  # the moved tip counts, not what came to lie upon it
        keep[np.flatnonzero(keep)[-1]], keep[-1] = len(np.flatnonzero(keep)) == 1, True
    columns = np.column_stack([radius, aero.chord, aero.twist, aero.prebend, aero.sweep])
    if keep.sum() < 2:
        raise aero.blade_file.refusal("needs two nodes between root and tip")
    return columns[keep], [name for name, kept in zip(aero.airfoil, keep, strict=True) if kept]


def tower_drag(deck):
    """(base diameter, top diameter, drag coefficient) whose load is that of the deck's tower in even wind."""
    table, values = deck.aerodyn.tower, deck.elastodyn
    base, top = values["TowerBsHt"], values["TowerHt"]
    if len(table) < 2 or not (table[:, 1] > 0.0).all():
        return 6.0, 4.0, 0.0
    z = np.linspace(base, top, 401)
    diameter = np.interp(z, table[:, 0], table[:, 1])
    load = np.trapezoid(diameter * np.interp(z, table[:, 0], table[:, 2]), z)
    ends = float(diameter[0]), float(diameter[-1])
    coefficient = load / (0.5 * sum(ends) * (top - base)) if deck.aerodyn.tower_loads else 0.0
    return *ends, float(coefficient)


# --------------------------------------------------------------------------- files


def platform_rows(deck, name, turbine, coefficients, distribution, options=None):
    """{table: rows} of platform.toml; "" is its head, "lines" and "members" are lists of tables."""
    site, values = deck.site, deck.elastodyn
    source = values.file.source
    mass, centre, inertia = ballast(deck)
    water = f" and the water of {len(deck.hydrodyn.fills)} members" if deck.hydrodyn.fills else ""
    tower, tower_height, tower_inertia = tower_mass(deck)
    base_diameter, top_diameter, drag = tower_drag(deck)
    bearing = ", YawBrMass at its top" if values["YawBrMass"] else ""
    exponent = deck.inflow.shear_exponent
    tables = {
        "": [
            Row("name", name),
            Row("turbine", turbine),
            Row("source", f"imported from {deck.name}"),
        ],
        "environment": [
            *(Row(key, getattr(site, key), site.sources[key])
              for key in ("gravity", "water_density", "air_density", "water_depth")),
            Row("shear_exponent", DEFAULT_SHEAR if exponent is None else exponent,
                "InflowWind" if exponent is not None else "offshore value of IEC 61400-3: not in the deck"),
        ],
        "ballast": [
            Row("mass", mass, source("PtfmMass") + water),
            Row("cm_depth", -centre[2], source("PtfmCMzt") + water),
            *([Row("cm_downwind", centre[0], source("PtfmCMxt") + water)] if abs(centre[0]) > 1e-9 else []),
            *([Row("cm_left", centre[1], source("PtfmCMyt") + water)] if abs(centre[1]) > 1e-9 else []),
            Row("inertia", list(np.diag(inertia)), source("PtfmRIner", "PtfmPIner", "PtfmYIner") + water),
        ],
        "tower": [
            Row("mass", tower, source("TwrFile") + f", TwrNodes elements{bearing}"),
            Row("cm_height", tower_height, "the same"),
            Row("inertia", [tower_inertia, tower_inertia, 0.0], "the same; none about its axis in ElastoDyn"),
            Row("base_height", values["TowerBsHt"], source("TowerBsHt")),
            Row("top_height", values["TowerHt"], source("TowerHt")),
            Row("base_diameter", base_diameter, deck.aerodyn.file.source("TwrDiam")),
            Row("top_diameter", top_diameter, deck.aerodyn.file.source("TwrDiam")),
            Row("drag_coefficient", drag, deck.aerodyn.file.source("TwrCd") + ", of the table's load"),
        ],
    }  # fmt: skip
    if values.bending is not None:
        tables["tower.modes"] = _bending_rows(values.bending, distribution)
    hydro = deck.hydrodyn
    if hydro.potential is not None:
        tables["potential_flow"] = [
            Row("coefficients", coefficients, f"WAMIT's files {hydro.file.source('PotFile')}"),
            Row("displaced_volume", hydro.potential.volume, hydro.file.source("PtfmVol0")),
            Row("centre_of_buoyancy", list(hydro.potential.centre_of_buoyancy),
                hydro.file.source("PtfmCOBxt", "PtfmCOByt")),
        ]  # fmt: skip
        if (depth := draft(deck)) is not None:
            tables["potential_flow"].append(Row("draft", depth, hydro.file.source("Jointzi")))
    added = [
        Row(key, value, comment)
        for key, value, comment in (
            ("preload", hydro.preload, hydro.file.source("AddF0")),
            ("stiffness", *additional_stiffness(deck)),
            ("linear_damping", hydro.linear_damping, hydro.file.source("AddBLin")),
            ("quadratic_damping", hydro.quadratic_damping, hydro.file.source("AddBQuad")),
        )
        if np.any(value)
    ]
    if added:
        tables["additional"] = added
    tables["members"] = [_member_rows(member) for member in hydro.members if _counts(member)]
    tables["lines"] = [
        [
            Row("anchor", list(line.anchor)),
            Row("fairlead", list(line.fairlead)),
            Row("length", line.length),
            Row("wet_weight", line.wet_weight, f"of {line.kind}: mass less displaced water, times gravity"),
            Row("EA", line.EA),
            *([Row("seabed_friction", line.seabed_friction)] if line.seabed_friction else []),
        ]
        for line in deck.lines
    ]
    if options:
        tables["options"] = [Row(key, value) for key, value in options.items()]
    return tables


def _bending_rows(modes, distribution):
    """Rows of [tower.modes] of a descriptions.tower_modes.TowerBending."""
    rows = [
        Row(
            "distribution",
            distribution,
            "tower: TMassDen, TwFAStif, TwSSStif, with AdjTwMa, AdjFASt, AdjSSSt",
        ),
        Row("fore_aft", modes.fore_aft, "tower: TwFAM1Sh, TwFAM2Sh, of the powers 2 to 6"),
        Row("side_side", modes.side_side, "tower: TwSSM1Sh, TwSSM2Sh"),
        Row("fore_aft_damping", modes.fore_aft_damping, "tower: TwrFADmp"),
        Row("side_side_damping", modes.side_side_damping, "tower: TwrSSDmp"),
    ]
    for name, key in (("fore_aft_tuner", "FAStTunr"), ("side_side_tuner", "SSStTunr")):
        if any(factor != 1.0 for factor in getattr(modes, name)):
            rows.append(Row(name, getattr(modes, name), f"tower: {key}"))
    if modes.top_mass:
        rows.append(Row("top_mass", modes.top_mass, "ElastoDyn: YawBrMass, in the mass above too"))
    return [*rows, Row("elements", modes.elements, "ElastoDyn: TwrNodes")]


def draft(deck):
    """Depth of the lowest end of a member (m), or None where none is below water."""
    depths = [-end[2] for member in deck.hydrodyn.members for end in (member.start, member.end)]
    return max(depths) if depths and max(depths) > 0.0 else None


def _counts(member):
    """Whether a member has any load: one in the potential-flow body has drag alone."""
    if not member.potential_flow:
        return True
    return any(member.drag) or any(any(end[:2]) for end in member.axial)


def _member_rows(member):
    """Rows of a table of members."""
    rows = [
        Row("start", list(member.start), f"member {member.number}"),
        Row("end", list(member.end)),
        Row("diameter", list(member.diameter)),
        Row("drag_coefficient", list(member.drag)),
    ]
    if member.potential_flow:
        rows.append(Row("potential_flow", True))
    if not member.potential_flow:
        rows.append(Row("added_mass_coefficient", list(member.added_mass)))
        rows.append(Row("pressure_coefficient", list(member.pressure)))
    axial = list(zip(*member.axial, strict=True))
    for key, value, usual in (
        ("axial_drag_coefficient", axial[0], (0.0, 0.0)),
        ("axial_added_mass_coefficient", axial[1], (0.0, 0.0)),
        ("axial_pressure_coefficient", axial[2], None),
    ):
        if tuple(value) != usual and not (usual is None and member.potential_flow):
            comment = (
                "half of AxCd: HydroDyn's is on rho A |v| v / 4" if key == "axial_drag_coefficient" else ""
            )
            rows.append(Row(key, list(value), comment))
    return rows


def _second_order(control, why):
    """Table of the pitch drive of second order, where the deck's controller has one."""
    if control.second_order is None:
        return {}
    frequency, damping = control.second_order
    return {
        "pitch_drive.second_order": [
            Row(
                "natural_frequency", frequency, why["natural_frequency"] + "; used where a scene asks for it"
            ),
            Row("damping", damping, why["damping"]),
        ]
    }


def turbine_rows(deck, name):
    """{table: rows} of turbine.toml."""
    values, control = deck.elastodyn, deck.control
    source, why = values.file.source, control.sources
    rotor = rotor_mass(deck)
    overhang, height = hub_place(deck)
    rated = control.rated_speed / values["GBRatio"]
    nacelle = values["NacYIner"] - values["NacMass"] * (values["NacCMxn"] ** 2 + values["NacCMyn"] ** 2)
    if nacelle < 0.0:
        raise values.file.wrong(
            "NacYIner",
            values["NacYIner"],
            f">= {values['NacYIner'] - nacelle:g}, NacMass at NacCMxn and NacCMyn alone",
        )
    law = {"rated_torque": control.rated_torque, "rated_power": control.rated_power,
           "rated_speed": control.rated_speed} | control.law  # fmt: skip
    why = {"rated_power": "rated_torque times rated_speed, mechanical"} | why
    law_rows = [Row(key, value, why.get(key, "")) for key, value in law.items()]
    blades = source("BldFile(1)", "HubMass", "HubIner")
    span = values.blade.radius - values["HubRad"]
    own = [float(values.blade.mass @ span**power) for power in range(3)]
    tables = {
        "": [
            Row("name", name),
            Row("source", f"imported from {deck.name}"),
            *([Row("discon", DISCON, "of the controller rosco")] if control.discon else []),
            Row("rated_rotor_speed_rpm", rated / RPM, f"{why.get('rated_speed', '')} over GBRatio"),
            Row("rated_wind_speed", control.rated_wind_speed or 11.4, why.get("rated_wind_speed", "a guess")),
            Row("cut_in_wind_speed", control.cut_in_wind_speed, why.get("cut_in_wind_speed", "usual value")),
            Row("cut_out_wind_speed", control.cut_out_wind_speed, why.get("cut_out_wind_speed", "usual")),
            Row("overspeed_rpm", OVERSPEED * rated / RPM,
                f"{OVERSPEED} times rated: failure threshold of the environment, a choice of this project"),
        ],
        "rotor": [
            Row("blades", values.blades, source("NumBl")),
            Row("mass", rotor.mass, blades + ", BldNodes elements"),
            Row("overhang", overhang, source("OverHang", "ShftTilt")),
            Row("hub_height", height, source("TowerHt", "Twr2Shft", "OverHang", "ShftTilt")),
            Row("hub_radius", values["HubRad"], source("HubRad")),
            Row("tip_radius", values["TipRad"], source("TipRad")),
            Row("inertia", rotor.inertia, blades + ", PreCone"),
            Row("inertia_diameter", rotor.inertia_diameter, blades + ", PreCone; of the hub none"),
            Row("shaft_tilt_deg", -math.degrees(values["ShftTilt"]) + 0.0, "minus " + source("ShftTilt")),
            Row("cone_deg", -math.degrees(values["PreCone"]) + 0.0, "minus " + source("PreCone(1)")),
            Row("cm_offset", rotor.cm_offset, blades + ", HubCM, PreCone"),
            Row("blade_mass", own[0], source("BldFile(1)") + ", BldNodes elements"),
            Row("blade_first_moment", own[1], "the same, about the root"),
            Row("blade_second_moment", own[2], "the same, about the root"),
        ],
        "nacelle": [
            Row("mass", values["NacMass"], source("NacMass")),
            Row("cm_downwind", values["NacCMxn"], source("NacCMxn")),
            *([Row("cm_left", values["NacCMyn"], source("NacCMyn"))] if values["NacCMyn"] else []),
            Row("cm_height", values["TowerHt"] + values["NacCMzn"], source("TowerHt", "NacCMzn")),
            Row("inertia", [0.0, 0.0, nacelle], source("NacYIner") + " less NacMass at NacCMxn; yaw alone"),
        ],
        "drivetrain": [
            Row("gear_ratio", values["GBRatio"], source("GBRatio")),
            Row("generator_inertia", values["GenIner"], source("GenIner") + ", about the high-speed shaft"),
            Row("mesh_loss", 1.0 - values["GBoxEff"] / 100.0, "1 less " + source("GBoxEff")),
            Row("bearing_loss", 0.0, "none in ElastoDyn"),
            Row("generator_efficiency", control.generator_efficiency,
                why.get("generator_efficiency", "not in the deck")),
        ],
        "pitch_drive": [
            Row("time_constant", control.time_constant,
                why.get("time_constant", "followed at once: no actuator in the deck")),
            Row("rate_limit_deg_per_s", math.degrees(control.pitch_rate), why.get("pitch_rate", "")),
            Row("minimum_deg", math.degrees(control.minimum_pitch), why.get("minimum_pitch", "usual value")),
            Row("maximum_deg", math.degrees(control.maximum_pitch), why.get("maximum_pitch", "usual value")),
        ],
        **_second_order(control, why),
        "torque_law": law_rows,
    }  # fmt: skip
    for gain_set, (proportional, integral, half) in control.gains.items():
        tables[f"gains.{gain_set}"] = [
            Row("KP", proportional, why.get("gains", "")),
            Row("KI", integral, why.get("gains", "")),
            Row("gain_schedule_pitch", half, "rad, at which the gains are half"),
        ]
    tables["blade"] = [Row("stations", "blade.csv"), Row("polars", "polars")]
    return tables
