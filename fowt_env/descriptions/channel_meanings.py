"""Describes the output channels in words; names and definitions are those of OpenFAST's output lists."""

import re

MEANINGS = {
    "Time": "time since the start of the run",
    "PtfmSurge": "platform surge, downwind",
    "PtfmSway": "platform sway, to the left looking downwind",
    "PtfmHeave": "platform heave, upwards",
    "PtfmRoll": "platform roll",
    "PtfmPitch": "platform pitch, tower top downwind",
    "PtfmYaw": "platform yaw",
    "PtfmTVxi": "surge velocity, inertial axes",
    "PtfmTVyi": "sway velocity, inertial axes",
    "PtfmTVzi": "heave velocity, inertial axes",
    "PtfmRVxi": "angular velocity of the platform about x",
    "PtfmRVyi": "angular velocity of the platform about y (pitch rate)",
    "PtfmRVzi": "angular velocity of the platform about z",
    "PtfmTAxi": "surge acceleration, inertial axes",
    "PtfmTAyi": "sway acceleration, inertial axes",
    "PtfmTAzi": "heave acceleration, inertial axes",
    "PtfmRAxi": "angular acceleration of the platform about x",
    "PtfmRAyi": "angular acceleration of the platform about y",
    "PtfmRAzi": "angular acceleration of the platform about z",
    "NcIMUTAxs": "nacelle acceleration, fore-aft, at the tower top",
    "NcIMUTAys": "nacelle acceleration, side to side, at the tower top",
    "Azimuth": "rotor azimuth, blade 1 upwards at 0",
    "RotSpeed": "rotor speed",
    "GenSpeed": "generator speed, high-speed shaft",
    "BldPitch1": "blade pitch (of blade 1 with individual pitch)",
    "BldPitch2": "pitch of blade 2",
    "BldPitch3": "pitch of blade 3",
    "GenTq": "generator torque, high-speed shaft",
    "GenPwr": "electrical power",
    "GenTqLim": "1 while the torque is at its range or rate limit",
    "RotThrust": "rotor thrust on the shaft, with weight and inertia",
    "RotTorq": "rotor torque on the low-speed shaft, with inertia",
    "RtFldFxh": "aerodynamic thrust of the rotor",
    "RtFldMxh": "aerodynamic torque of the rotor",
    "RtVAvgxh": "wind over the rotor, along the shaft, relative to the hub",
    "TwrBsFxt": "tower-base force, fore-aft",
    "TwrBsFyt": "tower-base force, side to side",
    "TwrBsFzt": "tower-base force, axial",
    "TwrBsMxt": "tower-base moment, side to side",
    "TwrBsMyt": "tower-base moment, fore-aft",
    "TwrBsMzt": "tower-base moment, torsion",
    "HydroFxi": "hydrodynamic force on the hull, x",
    "HydroFyi": "hydrodynamic force on the hull, y",
    "HydroFzi": "hydrodynamic force on the hull, z, with buoyancy",
    "HydroMxi": "hydrodynamic moment on the hull about x, at the body origin",
    "HydroMyi": "hydrodynamic moment on the hull about y, at the body origin",
    "HydroMzi": "hydrodynamic moment on the hull about z, at the body origin",
    "Wave1Elev": "wave elevation at the origin",
    "Wind1VelX": "wind at hub height, downwind",
    "Wind1VelY": "wind at hub height, sideways",
    "Wind1VelZ": "wind at hub height, upwards",
    "FAIRTEN": "tension of the mooring line at the fairlead",
    "ANCHTEN": "tension of the mooring line at the anchor",
    "OoPDefl": "deflection of the blade tip out of the rotor plane, downwind (TipDxc)",
    "IPDefl": "deflection of the blade tip in the rotor plane, against the rotation (TipDyc)",
    "TipDzc": "displacement of the blade tip along the pitch axis, outwards",
    "TipDxb": "displacement of the blade tip flapwise, axes turned by the pitch",
    "TipDyb": "displacement of the blade tip edgewise, axes turned by the pitch",
    "RootFxc": "blade-root force out of the rotor plane",
    "RootFyc": "blade-root force in the rotor plane",
    "RootFzc": "blade-root force along the pitch axis",
    "RootMxb": "blade-root moment by edgewise forces, axes turned by the pitch",
    "RootMyb": "blade-root moment by flapwise forces, axes turned by the pitch",
    "RootMzc": "pitching moment at the blade root, about the pitch axis",
    "Spn1MLxb": "edgewise bending moment of the blade at a quarter of its span",
    "Spn1MLyb": "flapwise bending moment of the blade at a quarter of its span",
    "Spn2MLxb": "edgewise bending moment of the blade at half of its span",
    "Spn2MLyb": "flapwise bending moment of the blade at half of its span",
    "LSSTipMya": "bending moment of the shaft at the rotor centre about y, turning with the shaft",
    "LSSTipMza": "bending moment of the shaft at the rotor centre about z, turning with the shaft",
    "LSShftFys": "force of the rotor on the shaft, sideways",
    "LSShftFzs": "force of the rotor on the shaft, upwards",
    "LSShftFya": "force of the rotor on the shaft along y, turning with the shaft",
    "LSShftFza": "force of the rotor on the shaft along z, turning with the shaft",
    "RootMxc": "blade-root moment in the rotor plane",
    "RootMyc": "blade-root moment out of the rotor plane",
    "LSSTipMys": "bending moment of the shaft at the hub about y, non-rotating",
    "LSSTipMzs": "bending moment of the shaft at the hub about z, non-rotating",
    "YawBrMxp": "yaw-bearing moment, roll",
    "YawBrMyp": "yaw-bearing moment, tilt",
    "YawBrMzp": "yaw-bearing moment, yaw",
    "TTDspFA": "tower-top deflection, fore-aft",
    "TTDspSS": "tower-top deflection, side to side",
    "YawBrTAxp": "tower-top acceleration along x of the rotated axes",
    "YawBrTAyp": "tower-top acceleration along y of the rotated axes",
    "Q_DrTr": "twist of the shaft, azimuth of the rotor less that of the generator",
    "QD_DrTr": "rate of the twist of the shaft",
}


def channel_meaning(name):
    """Return the description of a channel by its name, with or without unit; "" for a user-defined load.

    Channels of a line or blade end with its number: FAIRTEN2, RootMyc3.
    """
    name = name.partition("_[")[0]
    if name in MEANINGS:
        return MEANINGS[name]
    family, number = re.fullmatch(r"(.*?)(\d*)", name).groups()
    if family not in MEANINGS or not number:
        return ""
    part = "line" if family.endswith("TEN") else "blade"
    return f"{MEANINGS[family]}, {part} {number}"
