"""Converts a deck to the values of this project's platform and turbine files, each value with its source.

A table of a file is a list of rows (key, value, comment); a value is a number, a list, or a text; rows with
value None are omitted. output.py writes the files.
"""

import math

import numpy as np

from fowt_env.descriptions.platform import TURBULENCE
from fowt_env.descriptions.rotor_mass import rotor_mass_properties
from fowt_env.descriptions.units import DEGREE, PERCENT, RPM
from fowt_env.files.openfast_deck.hydrodyn import is_old
from fowt_env.files.openfast_deck.rosco_files import DISCON
from fowt_env.files.openfast_deck.servodyn import LEGACY_SOURCE

NEAR = 0.05  # m, of the outermost blade stations from hub and tip: line loads fall to zero there
OVERSPEED = 1.3  # of the rated speed: failure threshold of the environment, a choice of this project
DEFAULT_SHEAR = 0.14


def mass_properties(deck):
    """Return {name: mass} of the parts and the total, kg, as in ElastoDyn's summary."""
    values = deck.elastodyn
    parts = {
        "blade": float(values.blade.mass.sum()),
        "rotor": values["HubMass"] + values.blades * float(values.blade.mass.sum()),
        "nacelle": values["NacMass"],
        "yaw bearing": values["YawBrMass"],
    }
    parts["tower top"] = parts["rotor"] + values["NacMass"] + values["YawBrMass"]
    parts |= {
        "tower": values.tower[0],
        "platform": values["PtfmMass"],
        "ballast water": sum(fill.mass for fill in deck.hydrodyn.fills),
    }
    return parts | {"total": sum(parts[key] for key in ("tower top", "tower", "platform", "ballast water"))}


def rotor_mass(deck):
    """Return the RotorMass of straight blades along the coned pitch axis, as in ElastoDyn."""
    values = deck.elastodyn
    if values["HubMass"] + values.blade.mass.sum() <= 0.0:
        raise values.file.wrong("HubMass", values["HubMass"], "> 0 with massless blades")
    return rotor_mass_properties(
        values.blade, blades=values.blades, cone=-values["PreCone"], hub_mass=values["HubMass"],
        hub_inertia=values["HubIner"], hub_cm=values["HubCM"],
    )  # fmt: skip


def ballast(deck):
    """Return (mass, centre (3,), inertia tensor (3, 3) about it) of the platform with ballast water."""
    values = deck.elastodyn
    xy, yz, xz = values.platform_products
    inertia = np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])
    inertia += np.diag([values[f"Ptfm{axis}Iner"] for axis in "RPY"])
    position = np.array([values[f"PtfmCM{axis}t"] for axis in "xyz"])
    bodies = [(values["PtfmMass"], position, inertia)]
    bodies += [(fill.mass, np.array(fill.centre), fill.inertia) for fill in deck.hydrodyn.fills]
    mass = sum(body[0] for body in bodies)
    if mass <= 0.0:
        raise values.file.wrong("PtfmMass", values["PtfmMass"], "> 0: a floating platform")
    centre = sum(body[0] * body[1] for body in bodies) / mass
    total = np.zeros((3, 3))
    for part, at, tensor in bodies:
        d = at - centre
        total += tensor + part * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, centre, total


def additional_stiffness(deck):
    """Return ((6, 6) stiffness, comment): AddCLin, for old files (is_old) less the ballast water's restoring.

    In all other files the weight of the water moves with the members.
    """
    hydro, source = deck.hydrodyn, deck.hydrodyn.file.source("AddCLin")
    stiffness = np.array(hydro.added["AddCLin"])
    if not hydro.fills or not is_old(hydro.file):
        return stiffness, source
    of_water = np.zeros((6, 6))
    for fill in hydro.fills:
        x, y, z = np.array(fill.centre) * fill.mass * deck.site.gravity
        of_water[[3, 4], [3, 4]] -= z
        of_water[[3, 4], 5] += x, y
    rest = stiffness - of_water
    rest[np.abs(rest) < 1e-6 * np.abs(of_water).max()] = 0.0
    return rest, f"{source}, less the restoring moment of the ballast water's weight"


def hub_place(deck):
    """Return (overhang, hub height): the rotor centre upwind of the tower axis and above still water, m."""
    values, tilt = deck.elastodyn, deck.elastodyn["ShftTilt"]
    height = values["TowerHt"] + values["Twr2Shft"] + values["OverHang"] * math.sin(tilt)
    return -values["OverHang"] * math.cos(tilt), height


def stations(deck):
    """Return ((n, 5) radius, chord, twist (deg), prebend, sweep; airfoils) of the blade stations."""
    aero, hub, tip = deck.aerodyn, deck.elastodyn["HubRad"], deck.elastodyn["TipRad"]
    span = aero.blade[:, 0]
    radius = hub + span
    if radius[-1] > tip * 1.005:
        allowed = f"must be within TipRad - HubRad = {tip - hub:g} m"
        raise aero.blade_file.refusal(f"BlSpn ends at {span[-1]:g} m: {allowed}")
    radius = np.clip(radius, hub + NEAR, tip - NEAR)
    keep = np.concatenate([[True], np.diff(radius) > 1e-6])
    if not keep[-1]:  # the tip station replaces a station at the same radius
        keep[np.flatnonzero(keep)[-1]], keep[-1] = len(np.flatnonzero(keep)) == 1, True
    if keep.sum() < 2:
        raise aero.blade_file.refusal("needs two nodes between root and tip")
    columns = np.column_stack([radius, aero.blade[:, 1:]])
    return columns[keep], [name for name, kept in zip(aero.airfoil, keep, strict=True) if kept]


def tower_drag(deck):
    """Return (base diameter, top diameter, drag coefficient) of equal drag on the tower in uniform wind."""
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


def tower_table(deck):
    """Return AeroDyn's tower table (k, 4) for the influence on the wind; None if it has no such tower.

    A turbulence intensity that only Eames' model reads is replaced where it is out of that model's range.
    """
    aero = deck.aerodyn
    table = aero.tower.copy()
    if len(table) < 2 or not ((table[:, 1] > 0.0).all() and (np.diff(table[:, 0]) > 0.0).all()):
        return None
    if aero.tower_influence.get("tower_shadow") != "eames":
        table[(table[:, 3] < 0.05) | (table[:, 3] > 1.0), 3] = TURBULENCE
    return table


# --------------------------------------------------------------------------- files


def platform_rows(deck, name, turbine, coefficients, distribution):
    """Return {table: rows} of platform.toml; "": top level; "lines" and "members" are lists of tables."""
    site, hydro = deck.site, deck.hydrodyn
    exponent = deck.inflow.shear_exponent
    shear = "InflowWind" if exponent is not None else "offshore value of IEC 61400-3: not in the deck"
    mass, centre, inertia = ballast(deck)
    water = f" and the water of {len(hydro.fills)} members" if hydro.fills else ""

    def source(*keys):
        return deck.elastodyn.file.source(*keys) + water

    def nonzero(value):
        return value if abs(value) > 1e-9 else None

    tables = {
        "": [("name", name), ("turbine", turbine), ("source", f"imported from {deck.name}")],
        "environment": [
            *((key, getattr(site, key), site.sources[key])
              for key in ("gravity", "water_density", "air_density", "water_depth")),
            ("shear_exponent", DEFAULT_SHEAR if exponent is None else exponent, shear),
        ],
        "ballast": [
            ("mass", mass, source("PtfmMass")),
            ("cm_depth", -centre[2], source("PtfmCMzt")),
            ("cm_downwind", nonzero(centre[0]), source("PtfmCMxt")),
            ("cm_left", nonzero(centre[1]), source("PtfmCMyt")),
            ("inertia", list(np.diag(inertia)), source("PtfmRIner", "PtfmPIner", "PtfmYIner")),
        ],
    } | _tower_rows(deck, distribution)  # fmt: skip
    source = hydro.file.source
    if hydro.potential is not None:
        tables["potential_flow"] = [
            ("coefficients", coefficients, f"WAMIT's files {source('PotFile')}"),
            ("displaced_volume", hydro.potential.volume, source("PtfmVol0")),
            ("centre_of_buoyancy", hydro.potential.centre_of_buoyancy, source("PtfmCOBxt", "PtfmCOByt")),
            ("draft", draft(deck), source("Jointzi")),
        ]
    added = [
        ("preload", hydro.added["AddF0"], source("AddF0")),
        ("stiffness", *additional_stiffness(deck)),
        ("linear_damping", hydro.added["AddBLin"], source("AddBLin")),
        ("quadratic_damping", hydro.added["AddBQuad"], source("AddBQuad")),
    ]
    if any(np.any(row[1]) for row in added):
        tables["additional"] = [row for row in added if np.any(row[1])]
    tables["members"] = [
        _member_rows(member) for member in hydro.members
        # members inside the potential-flow body have drag only
        if not member.potential_flow or any(member.drag) or any(any(end[:2]) for end in member.axial)
    ]  # fmt: skip
    alike = bool(deck.lines) and deck.lines[0].dynamics is not None
    alike = alike and all(line.dynamics == deck.lines[0].dynamics for line in deck.lines)
    tables["lines"] = [
        [
            ("anchor", line.anchor),
            ("fairlead", line.fairlead),
            ("length", line.length),
            ("wet_weight", line.wet_weight, f"of {line.kind}: mass less displaced water, times gravity"),
            ("EA", line.EA),
            ("seabed_friction", line.seabed_friction or None),
            ("dynamics", None if alike else line.dynamics),
        ]
        for line in deck.lines
    ]
    if alike:
        tables["line_dynamics"] = list(deck.lines[0].dynamics.items())
    return tables


def _tower_rows(deck, distribution):
    """Return the tables of the tower and of its influence on the wind; [tower.modes] with mode shapes."""
    values, modes = deck.elastodyn, deck.elastodyn.bending
    source, aero = values.file.source, deck.aerodyn.file.source
    base, extra, length = values["TowerBsHt"], values["YawBrMass"], values["TowerHt"] - values["TowerBsHt"]
    # the yaw bearing is a point at the top
    mass, first, second = (moment + extra * length**power for power, moment in enumerate(values.tower))
    centre = first / mass if mass else 0.5 * length
    across = max(second - mass * centre**2, 0.0)
    base_diameter, top_diameter, drag = tower_drag(deck)
    tables = {"tower": [
        ("mass", mass, source("TwrFile") + ", TwrNodes elements" + ", YawBrMass at its top" * bool(extra)),
        ("cm_height", base + centre, "the same"),
        ("inertia", [across, across, 0.0], "the same; none about its axis in ElastoDyn"),
        ("base_height", base, source("TowerBsHt")),
        ("top_height", values["TowerHt"], source("TowerHt")),
        ("base_diameter", base_diameter, aero("TwrDiam")),
        ("top_diameter", top_diameter, aero("TwrDiam")),
        ("drag_coefficient", drag, aero("TwrCd") + ", of the table's load"),
    ]}  # fmt: skip
    if (sections := tower_table(deck)) is not None:
        keys = ("height", "diameter", "drag_coefficient", "turbulence_intensity")
        names = ("TwrElev", "TwrDiam", "TwrCd", "TwrTI")
        tables["tower.sections"] = [
            (key, list(column), aero(name)) for key, name, column in zip(keys, names, sections.T, strict=True)
        ]
        if deck.aerodyn.tower_influence:
            names = {"tower_potential": "TwrPotent", "tower_shadow": "TwrShadow"}
            tables["options"] = [
                (option, model, aero(names[option])) for option, model in deck.aerodyn.tower_influence.items()
            ]
    if modes is None:
        return tables

    return tables | {"tower.modes": [
        ("distribution", distribution, "tower: TMassDen, TwFAStif, TwSSStif, with AdjTwMa, AdjFASt, AdjSSSt"),
        ("fore_aft", modes.fore_aft, "tower: TwFAM1Sh, TwFAM2Sh, of the powers 2 to 6"),
        ("side_side", modes.side_side, "tower: TwSSM1Sh, TwSSM2Sh"),
        ("fore_aft_damping", modes.fore_aft_damping, "tower: TwrFADmp"),
        ("side_side_damping", modes.side_side_damping, "tower: TwrSSDmp"),
        ("fore_aft_tuner", _factors(modes.fore_aft_tuner), "tower: FAStTunr"),
        ("side_side_tuner", _factors(modes.side_side_tuner), "tower: SSStTunr"),
        ("top_mass", modes.top_mass or None, "ElastoDyn: YawBrMass, in the mass above too"),
        ("elements", modes.elements, "ElastoDyn: TwrNodes"),
    ]}  # fmt: skip


def _factors(tuner):
    """Return the stiffness tuners of modes; None if all are 1."""
    return tuner if set(tuner) != {1.0} else None


def draft(deck):
    """Return the depth of the lowest member end (m); None if no end is below water."""
    depths = [-end[2] for member in deck.hydrodyn.members for end in (member.start, member.end)]
    return max(depths) if depths and max(depths) > 0.0 else None


def _member_rows(member):
    """Return the rows of one [[members]] table."""
    inside = member.potential_flow
    drag, mass, pressure = zip(*member.axial, strict=True)
    return [
        ("start", member.start, f"member {member.number}"),
        ("end", member.end),
        ("diameter", member.diameter),
        ("drag_coefficient", member.drag),
        ("potential_flow", inside or None),
        ("added_mass_coefficient", None if inside else member.added_mass),
        ("pressure_coefficient", None if inside else member.pressure),
        ("axial_drag_coefficient", drag if any(drag) else None,
         "half of AxCd: HydroDyn's is on rho A |v| v / 4"),
        ("axial_added_mass_coefficient", mass if any(mass) else None),
        ("axial_pressure_coefficient", None if inside else pressure),
    ]  # fmt: skip


def turbine_rows(deck, name):
    """Return {table: rows} of turbine.toml."""
    values, control = deck.elastodyn, deck.control
    source, figures = values.file.source, control.figures
    rotor = rotor_mass(deck)
    overhang, height = hub_place(deck)
    rated, why = control["rated_speed"] / values["GBRatio"], figures["rated_speed"][1]
    apart = values["NacMass"] * (values["NacCMxn"] ** 2 + values["NacCMyn"] ** 2)
    if values["NacYIner"] < apart:
        allowed = f">= {apart:g}, NacMass at NacCMxn and NacCMyn alone"
        raise values.file.wrong("NacYIner", values["NacYIner"], allowed)
    blades, lumps = source("BldFile(1)", "HubMass", "HubIner"), source("BldFile(1)") + ", BldNodes elements"
    span = values.blade.radius - values["HubRad"]
    moments = [float(values.blade.mass @ span**power) for power in range(3)]

    def of_control(key, name=None, unit=1.0):
        value, comment = figures[name or key]
        return key, value / unit, comment

    tables = {
        "": [
            ("name", name),
            ("source", f"imported from {deck.name}"),
            ("discon", DISCON if control.discon else None, "of the controller rosco"),
            ("rated_rotor_speed_rpm", rated / RPM, f"{why} over GBRatio"),
            *map(of_control, ("rated_wind_speed", "cut_in_wind_speed", "cut_out_wind_speed")),
            ("overspeed_rpm", OVERSPEED * rated / RPM,
             f"{OVERSPEED} times rated: failure threshold of the environment, a choice of this project"),
        ],
        "rotor": [
            ("blades", values.blades, source("NumBl")),
            ("mass", rotor.mass, blades + ", BldNodes elements"),
            ("overhang", overhang, source("OverHang", "ShftTilt")),
            ("hub_height", height, source("TowerHt", "Twr2Shft", "OverHang", "ShftTilt")),
            ("hub_radius", values["HubRad"], source("HubRad")),
            ("tip_radius", values["TipRad"], source("TipRad")),
            ("inertia", rotor.inertia, blades + ", PreCone"),
            ("inertia_diameter", rotor.inertia_diameter, blades + ", PreCone; without the hub"),
            ("shaft_tilt_deg", -math.degrees(values["ShftTilt"]) + 0.0, "minus " + source("ShftTilt")),
            ("cone_deg", -math.degrees(values["PreCone"]) + 0.0, "minus " + source("PreCone(1)")),
            ("cm_offset", rotor.cm_offset, blades + ", HubCM, PreCone"),
            ("blade_mass", moments[0], lumps),
            ("blade_first_moment", moments[1], "the same, about the root"),
            ("blade_second_moment", moments[2], "the same, about the root"),
        ],
        "nacelle": [
            ("mass", values["NacMass"], source("NacMass")),
            ("cm_downwind", values["NacCMxn"], source("NacCMxn")),
            ("cm_left", values["NacCMyn"] or None, source("NacCMyn")),
            ("cm_height", values["TowerHt"] + values["NacCMzn"], source("TowerHt", "NacCMzn")),
            ("inertia", [0.0, 0.0, values["NacYIner"] - apart],
             source("NacYIner") + " less NacMass at NacCMxn; yaw alone"),
        ],
        "drivetrain": [
            ("gear_ratio", values["GBRatio"], source("GBRatio")),
            ("generator_inertia", values["GenIner"], source("GenIner") + ", about the high-speed shaft"),
            ("mesh_loss", 1.0 - values["GBoxEff"] / 100.0, "1 less " + source("GBoxEff")),
            ("bearing_loss", 0.0, "none in ElastoDyn"),
            of_control("generator_efficiency"),
        ],
        "shaft_torsion": [] if values.shaft is None else [
            ("stiffness", values.shaft.stiffness, source("DTTorSpr")),
            ("damping", values.shaft.damping, source("DTTorDmp")),
        ],
        "pitch_drive": [
            of_control("time_constant"),
            of_control("rate_limit_deg_per_s", "pitch_rate", DEGREE),
            of_control("minimum_deg", "minimum_pitch", DEGREE),
            of_control("maximum_deg", "maximum_pitch", DEGREE),
        ],
    }  # fmt: skip
    if "damping" in figures:
        frequency, comment = figures["natural_frequency"]
        tables["pitch_drive.second_order"] = [
            ("natural_frequency", frequency, comment + "; used with the option pitch_drive"),
            of_control("damping"),
        ]
    power = control["rated_torque"] * control["rated_speed"]
    tables["torque_law"] = [
        of_control("rated_torque"),
        ("rated_power", power, "rated_torque times rated_speed, mechanical"),
        of_control("rated_speed"),
        *((key, *figure) for key, figure in control.law.items()),
    ]
    for gain_set, (proportional, integral, half) in control.gains.items():
        tables[f"gains.{gain_set}"] = [
            ("KP", proportional, LEGACY_SOURCE),
            ("KI", integral, LEGACY_SOURCE),
            ("gain_schedule_pitch", half, "rad, at which the gains are halved"),
        ]
    tables["blade"] = [("stations", "blade.csv"), ("polars", "polars")]
    tables["blade_structure"] = _structure_rows(values.structure)
    return tables


def _structure_rows(structure):
    """Return the rows of [blade_structure] of a BladeStructure; none for None."""
    if structure is None:
        return []
    of = "ElastoDyn blade: "
    columns = "StrcTwst, BMassDen, FlpStff, EdgStff, with AdjBlMs, AdjFlSt, AdjEdSt"
    return [
        ("distribution", "blade_structure.csv", of + columns),
        ("flap_1", structure.flap_1, of + "BldFl1Sh, of the powers 2 to 6"),
        ("flap_2", structure.flap_2, of + "BldFl2Sh"),
        ("edge_1", structure.edge_1, of + "BldEdgSh"),
        ("damping_ratio_percent", [ratio / PERCENT for ratio in structure.damping_ratio],
         of + "BldFlDmp, BldEdDmp"),
        ("flap_tuner", _factors(structure.flap_tuner), of + "FlStTunr"),
        ("tip_mass", structure.tip_mass or None, "ElastoDyn: TipMass(1), in blade_mass too"),
        ("elements", structure.elements, "ElastoDyn: BldNodes"),
    ]  # fmt: skip
