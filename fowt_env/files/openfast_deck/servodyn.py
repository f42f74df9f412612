"""Controller of a deck: ServoDyn's file and the DISCON.IN of ROSCO or of the legacy 5 MW controller.

The figures are what a torque law and a pitch drive of this project need, all in SI on the high-speed shaft.
"""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

from fowt_env.descriptions.units import RPM
from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare, locate, number_of, words_of
from fowt_env.files.openfast_deck.rosco_files import Performance


@dataclass(frozen=True)
class Control:
    """Figures of the controller; sources: a comment for each name."""

    generator_efficiency: float
    rated_torque: float  # N m
    rated_speed: float  # rad/s
    law: dict  # further entries of the torque law by their names in turbine files
    minimum_pitch: float  # rad
    maximum_pitch: float
    pitch_rate: float  # rad/s
    time_constant: float = 0.0  # s, of the pitch actuator
    second_order: tuple | None = None  # natural frequency (rad/s) and damping ratio of one with inertia
    rated_wind_speed: float | None = None
    cut_in_wind_speed: float = 3.0
    cut_out_wind_speed: float = 25.0
    gains: dict = field(default_factory=dict)  # set: (KP in s, KI, pitch in rad at which they are halved)
    sources: dict = field(default_factory=dict)
    notes: tuple = ()
    discon: PartFile | None = None  # written beside the turbine, with the table that it names
    performance: Performance | None = None

    @property
    def rated_power(self):
        """Mechanical, W."""
        return self.rated_torque * self.rated_speed


# NREL 5 MW: constants of its DISCON source (OpenFAST/r-test), which reads no file
LEGACY_LAW = {
    "cut_in_speed": 70.16224, "region2_start_speed": 91.21091, "region2_constant": 2.332287,
    "transition_speed": 121.6805, "slip_percent": 10.0, "region3_min_pitch": 0.01745329,
    "max_torque": 47402.91, "max_torque_rate": 15000.0, "speed_filter_corner": 1.570796,
}  # fmt: skip
LEGACY = {
    "rated_torque": 43093.55, "rated_speed": 122.9096, "minimum_pitch": 0.0, "maximum_pitch": math.pi / 2.0,
    "pitch_rate": math.radians(8.0), "rated_wind_speed": 11.4,
}  # fmt: skip
LEGACY_GAINS = {"oc3": (0.006275604, 0.0008965149, 0.1099965), "land": (0.01882681, 0.008068634, 0.1099965)}


def read_control(path, gear_ratio, discon=None, folders=(), air_density=1.225, radius=None):
    """Control of a ServoDyn file and of the DISCON.IN that it names.

    discon: a DISCON.IN instead of that. path: None where a deck has no ServoDyn file. Raises: InputError.
    """
    efficiency, servo, notes = 1.0, None, []
    sources = {}
    if path is not None:
        servo = PartFile(path, "ServoDyn")
        efficiency = servo.number("GenEff", default=100.0, low=1.0, high=100.0) / 100.0
        sources["generator_efficiency"] = servo.source("GenEff")
        notes += differences(servo)
    chosen = Path(discon) if discon is not None else None
    mode = 5 if servo is None else servo.whole("VSContrl", default=5)
    if chosen is None and mode not in (1, 3, 4, 5):
        raise servo.wrong(
            "VSContrl", mode, "1, 3, 4 or 5: give the DISCON.IN of another torque law with --discon"
        )
    if mode in (3, 4) or (chosen is not None and mode != 5):
        notes.append((f"generator torque by another law (VSContrl {mode})", "that of DISCON.IN"))
    if chosen is None and servo is not None and mode != 1:
        chosen = None if _is_legacy(servo) else _optional(servo, "DLL_InFile", folders)
        if chosen is not None and not _is_rosco(PartFile(chosen, "DISCON.IN")) and 96.0 < gear_ratio < 98.0:
            chosen = None  # the legacy controller of the NREL 5 MW turbine reads none
    if chosen is not None:
        control = _rosco(chosen, efficiency, air_density, radius, folders)
    elif servo is None:
        control = _legacy(None, efficiency, gear_ratio)
    elif mode == 1:
        control = _simple(servo, efficiency)
    else:
        control = _legacy(servo, efficiency, gear_ratio)
    return replace(control, sources=sources | control.sources, notes=(*notes, *control.notes))


def _is_rosco(file):
    """Whether a controller's file has ROSCO's keys."""
    return any(file.has(key) for key in ("PC_RefSpd", "VS_RefSpd", "VS_RtTq"))


def _is_legacy(servo):
    """Whether the library is one of those of the NREL 5 MW turbine that read no file, by its name."""
    library = servo.text("DLL_FileName", default="").lower()
    return "discon_oc3" in library or "discon_iti" in library


def _optional(file, key, folders):
    """Path of the file that a key names, or None where it is not there."""
    name = file.text(key, default="unused")
    if name.lower() in ("", "none", "unused"):
        return None
    return locate(name, (file.path.parent, *folders))


def _legacy(servo, efficiency, gear_ratio):
    """Control of the NREL 5 MW turbine's own controller, known by its gear ratio; else refused."""
    library = "" if servo is None else servo.text("DLL_FileName", default="").lower()
    if not 96.0 <= gear_ratio <= 98.0 or (library and "discon" not in library):
        where = "the deck" if servo is None else f"ServoDyn file {str(servo.path)!r}"
        raise InputError(
            f"{where}: DLL_InFile names no DISCON.IN that is there, and the torque law is not of VSContrl 1:"
            " give the DISCON.IN with --discon"
        )
    text = "legacy controller of the NREL 5 MW turbine (source of its library)"
    names = {name: text for name in (*LEGACY, *LEGACY_LAW, "gains")}
    notes = () if servo is not None else (
        ("no ServoDyn file", "torque law and limits of the NREL 5 MW turbine, by the gear ratio"),
    )  # fmt: skip
    return Control(efficiency, law=LEGACY_LAW, **LEGACY, gains=LEGACY_GAINS, sources=names, notes=notes)


def _simple(servo, efficiency):
    """Control of ServoDyn's own simple variable speed."""
    speed = servo.number("VS_RtGnSp", low=0.0, high=1e5, open_low=True) * RPM
    torque = servo.number("VS_RtTq", low=0.0, high=1e12, open_low=True)
    constant = servo.number("VS_Rgn2K", low=0.0, high=1e14, open_low=True) / RPM**2
    slip = servo.number("VS_SlPc", low=0.0, high=100.0, open_low=True)
    law = {"minimum_speed": 0.3 * speed, "region2_constant": constant, "slip_percent": slip}
    source = servo.source("VS_RtGnSp", "VS_RtTq", "VS_Rgn2K", "VS_SlPc")
    rate = servo.number("PitManRat(1)", default=8.0, low=0.0, high=90.0, open_low=True)
    sources = {name: source for name in ("rated_torque", "rated_speed", "region2_constant", "slip_percent")}
    return Control(
        efficiency, torque, speed, law, 0.0, 0.5 * math.pi, math.radians(rate),
        sources=sources | {"minimum_speed": "30 % of rated speed: not in the deck",
                           "pitch_rate": servo.source("PitManRat(1)")},
        notes=(("no limits of torque, no filter of the speed", "those of the NREL 5 MW turbine, scaled"),),
    )  # fmt: skip


def _values(file, key, default=None):
    """Numbers of a key of ROSCO's file; also of one that stands at the end of a very long line."""
    for text in file.lines:
        front, mark, behind = text[:200_000].partition("!")
        words = words_of(behind)
        if mark and words and words[0].lower() == key.lower():
            values = [number_of(bare(word)) for word in words_of(front)]
            return None if None in values or not values else values
    return default


def _rosco(path, efficiency, air_density, radius, folders):
    """Control of ROSCO's input file, its versions 2.5 to 2.10."""
    file = PartFile(path, "DISCON.IN")
    if not _is_rosco(file):
        raise file.refusal("is not of ROSCO: PC_RefSpd, VS_RefSpd and VS_RtTq are missing")
    source = file.source
    efficiency_key = "VS_GenEff"
    if file.has(efficiency_key):
        efficiency = file.number(efficiency_key, low=1.0, high=100.0) / 100.0
    torque = file.number("VS_RtTq", low=0.0, high=1e12, open_low=True)
    speed = file.number("PC_RefSpd", "VS_RefSpd", low=0.0, high=1e5, open_low=True)
    constant = file.number("VS_Rgn2K", low=0.0, high=1e14, open_low=True)
    slowest = file.number("VS_MinOMSpd", default=0.0, low=0.0, high=1e5)
    # the law of a turbine file needs some region 1 1/2, which ROSCO may have at standstill
    known = 0.0 < slowest < 0.85 * speed
    law = {
        "minimum_speed": slowest if known else 0.3 * speed,
        "region2_constant": constant,
        "region3_min_pitch": file.number("PC_Switch", default=0.01745, low=0.0, high=1.0),
        "max_torque": max(file.number("VS_MaxTq", default=1.1 * torque, low=0.0, open_low=True), torque),
        "max_torque_rate": file.number("VS_MaxRat", default=0.348 * torque, low=0.0, open_low=True),
        "speed_filter_corner": file.number(
            "F_LPFCornerFreq", default=1.5708, low=0.0, high=1e3, open_low=True
        ),
    }
    notes = list(_rosco_notes(file))
    table = _optional(file, "PerfFileName", folders)
    performance = None if table is None else Performance(table)
    winds = _values(file, "WE_FOPoles_v") or _values(file, "PS_WindSpeeds") or []
    wind, how = _rated_wind(file, torque * speed, air_density, radius, performance)
    sources = {
        "rated_torque": source("VS_RtTq"), "rated_speed": source("PC_RefSpd"),
        "region2_constant": source("VS_Rgn2K"),
        "minimum_speed": source("VS_MinOMSpd") if known else "30 % of rated speed: not in the deck",
        "region3_min_pitch": source("PC_Switch"), "max_torque": source("VS_MaxTq"),
        "max_torque_rate": source("VS_MaxRat"), "speed_filter_corner": source("F_LPFCornerFreq"),
        "minimum_pitch": source("PC_MinPit"), "maximum_pitch": source("PC_MaxPit"),
        "pitch_rate": source("PC_MaxRat"), "rated_wind_speed": how,
        "time_constant": "followed at once: " + ("PA_Mode of " + path.name + " acts inside ROSCO"
                          if file.whole("PA_Mode", default=0) else "the deck has no actuator"),
        "generator_efficiency": source(efficiency_key),
        "natural_frequency": source("PA_CornerFreq"), "damping": source("PA_Damping"),
        "cut_in_wind_speed": source("WE_FOPoles_v"), "cut_out_wind_speed": source("WE_FOPoles_v"),
    }  # fmt: skip
    low = file.number("PC_MinPit", default=0.0, low=-1.0, high=1.0)
    high = file.number("PC_MaxPit", default=0.5 * math.pi, low=-1.0, high=2.0 * math.pi)
    if high <= low:
        raise file.wrong("PC_MaxPit", high, f"> PC_MinPit = {low:g}")
    control = Control(
        efficiency, torque, speed, law, low, high,
        file.number("PC_MaxRat", low=0.0, high=10.0, open_low=True),
        rated_wind_speed=wind, sources=sources, notes=tuple(notes), discon=file,
        performance=performance, second_order=_pitch_drive(file),
    )  # fmt: skip
    if len(winds) > 1 and 0.0 < winds[0] < wind < winds[-1]:
        control = replace(control, cut_in_wind_speed=winds[0], cut_out_wind_speed=winds[-1])
    return control


def _pitch_drive(file):
    """(natural frequency rad/s, damping ratio) of ROSCO's pitch actuator of second order, else None."""
    if file.whole("PA_Mode", default=0) != 2:
        return None
    return (
        file.number("PA_CornerFreq", low=0.0, high=100.0, open_low=True),
        file.number("PA_Damping", default=0.707, low=0.0, high=5.0, open_low=True),
    )


def _rosco_notes(file):
    """What the plain torque law of the turbine file has not, of ROSCO's."""
    yield (
        "ROSCO's torque law (VS_ControlMode {:g}, minimum speed VS_MinOMSpd)".format(
            file.whole("VS_ControlMode", default=2)
        ),
        "for the built-in controllers the law of regions 1 to 3: VS_Rgn2K from VS_MinOMSpd on, with a steep"
        " line below and one to VS_RtTq above it",
    )
    yield (
        "pitch gains of a table (PC_GS_angles, PC_GS_KP, PC_GS_KI)",
        "in the controller rosco, which runs the DISCON.IN; those of the others are derived from the rotor",
    )
    if file.whole("PS_Mode", default=0):
        yield "peak shaving (PS_Mode)", "in the controller rosco alone, which runs the DISCON.IN"
    if file.whole("PA_Mode", default=0):
        yield (
            "pitch actuator within ROSCO (PA_Mode)",
            "pitch_drive.time_constant 0: set it for other controllers"
            + (", or the option pitch_drive = 'second_order'" if _pitch_drive(file) else ""),
        )
    if file.whole("IPC_ControlMode", default=0):
        yield "individual pitch control (IPC_ControlMode)", "collective pitch"


def _rated_wind(file, power, air_density, radius, performance):
    """(m/s, where it is from): of ROSCO's own tables, or of power and the largest power coefficient."""
    ramp = _values(file, "IPC_Vramp")
    if ramp and len(ramp) > 1 and 5.0 < ramp[1] < 30.0:
        return ramp[1], file.source("IPC_Vramp, its second value")
    largest, name = 0.45, "a power coefficient of 0.45"
    if performance is not None and (found := performance.largest_power_coefficient) is not None:
        largest, name = found, f"the largest power coefficient {found:.3f} of {performance.name}"
    reach = file.number("WE_BladeRadius", default=radius, low=0.0, open_low=True)
    if reach is None:
        return 11.4, "a guess: no radius is known"
    speed = (power / (0.5 * air_density * math.pi * reach**2 * largest)) ** (1.0 / 3.0)
    return min(max(speed, 5.0), 20.0), f"rated power at {name}"
