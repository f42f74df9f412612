"""Reads the controller of a deck: ServoDyn's file and the DISCON.IN of ROSCO, or the legacy 5 MW controller.

The values are those of a torque law and a pitch drive of this project, in SI on the high-speed shaft.
"""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

from fowt_env.descriptions.units import RPM
from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare, locate, number_of, words_of
from fowt_env.files.openfast_deck.rosco_files import Performance, read_performance


@dataclass(frozen=True)
class Control:
    """Holds the controller of a deck; figures and law: {name: (value, comment)}, law as in turbine files."""

    figures: dict
    law: dict
    gains: dict = field(default_factory=dict)  # set: (KP in s, KI, pitch in rad at which they are halved)
    notes: tuple = ()
    discon: PartFile | None = None  # written to the turbine's folder, with the performance table
    performance: Performance | None = None

    def __getitem__(self, name):
        return self.figures[name][0]


USUAL = {  # defaults for values missing in a deck
    "generator_efficiency": (1.0, "not in the deck"),
    "time_constant": (0.0, "no lag: no actuator in the deck"),  # s
    "minimum_pitch": (0.0, "usual value"),  # rad
    "maximum_pitch": (0.5 * math.pi, "usual value"),
    "rated_wind_speed": (11.4, "estimate"),
    "cut_in_wind_speed": (3.0, "usual value"),
    "cut_out_wind_speed": (25.0, "usual value"),
}
# NREL 5 MW: constants in the DISCON source (OpenFAST/r-test), which reads no file
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
LEGACY_SOURCE = "legacy controller of the NREL 5 MW turbine (source of its library)"


def read_control(path, gear_ratio, discon=None, folders=(), air_density=1.225, radius=None):
    """Read the Control from a ServoDyn file and the DISCON.IN named there.

    discon: a DISCON.IN instead of the deck's. path: None for a deck without ServoDyn. Raises: InputError.
    """
    figures, servo, notes = USUAL, None, []
    if path is not None:
        servo = PartFile(path, "ServoDyn")
        efficiency = servo.number("GenEff", default=100.0, low=1.0, high=100.0) / 100.0
        figures = USUAL | {"generator_efficiency": (efficiency, servo.source("GenEff"))}
        notes += differences(servo)
    chosen = Path(discon) if discon is not None else None
    mode = 5 if servo is None else servo.whole("VSContrl", default=5)
    if chosen is None and mode not in (1, 3, 4, 5):
        allowed = "1, 3, 4 or 5: pass the DISCON.IN of another torque law with --discon"
        raise servo.wrong("VSContrl", mode, allowed)
    if mode in (3, 4) or (chosen is not None and mode != 5):
        notes.append((f"generator torque by another law (VSContrl {mode})", "torque law of DISCON.IN"))
    if chosen is None and servo is not None and mode != 1:
        library = servo.text("DLL_FileName", default="").lower()
        if "discon_oc3" not in library and "discon_iti" not in library:  # these read no file
            chosen = _optional(servo, "DLL_InFile", folders)
        if chosen is not None and not _is_rosco(PartFile(chosen, "DISCON.IN")) and 96.0 < gear_ratio < 98.0:
            chosen = None  # the legacy controller of the NREL 5 MW turbine reads no file
    if chosen is not None:
        control = _rosco(PartFile(chosen, "DISCON.IN"), figures, air_density, radius, folders)
    elif servo is not None and mode == 1:
        control = _simple(servo)
    else:
        control = _legacy(servo, gear_ratio)
    return replace(control, figures=figures | control.figures, notes=(*notes, *control.notes))


def _is_rosco(file):
    return any(file.has(key) for key in ("PC_RefSpd", "VS_RefSpd", "VS_RtTq"))


def _optional(file, key, folders):
    """Return the path of the file named by a key, or None if the file does not exist."""
    name = file.text(key, default="unused")
    return None if name.lower() in ("", "none", "unused") else locate(name, (file.path.parent, *folders))


def _legacy(servo, gear_ratio):
    """Return the Control of the NREL 5 MW legacy controller, identified by gear ratio. Raises: InputError."""
    library = "" if servo is None else servo.text("DLL_FileName", default="").lower()
    if not 96.0 <= gear_ratio <= 98.0 or (library and "discon" not in library):
        where = "the deck" if servo is None else f"ServoDyn file {str(servo.path)!r}"
        raise InputError(
            f"{where}: DLL_InFile names no existing DISCON.IN, and the torque law is not that of VSContrl 1:"
            " pass the DISCON.IN with --discon"
        )
    figures, law = (
        {name: (value, LEGACY_SOURCE) for name, value in table.items()} for table in (LEGACY, LEGACY_LAW)
    )
    note = ("no ServoDyn file", "torque law and limits of the NREL 5 MW turbine, by the gear ratio")
    return Control(figures, law, LEGACY_GAINS, notes=(note,) if servo is None else ())


def _simple(servo):
    """Return the Control of ServoDyn's simple variable-speed controller."""
    speed, torque = servo.positive("VS_RtGnSp", high=1e5) * RPM, servo.positive("VS_RtTq", high=1e12)
    constant = servo.positive("VS_Rgn2K", high=1e14) / RPM**2
    slip = servo.positive("VS_SlPc", high=100.0)
    rate = servo.positive("PitManRat(1)", default=8.0, high=90.0)
    source = servo.source("VS_RtGnSp", "VS_RtTq", "VS_Rgn2K", "VS_SlPc")
    return Control(
        figures={
            "rated_torque": (torque, source),
            "rated_speed": (speed, source),
            "pitch_rate": (math.radians(rate), servo.source("PitManRat(1)")),
        },
        law={
            "minimum_speed": (0.3 * speed, "30 % of rated speed: not in the deck"),
            "region2_constant": (constant, source),
            "slip_percent": (slip, source),
        },
        notes=(("no torque limits, no speed filter", "those of the NREL 5 MW turbine, scaled"),),
    )


def _values(file, key):
    """Return the numbers of a key of ROSCO's file, or None; lines may be very long."""
    for text in file.lines:
        front, mark, behind = text[:200_000].partition("!")
        words = words_of(behind)
        if mark and words and words[0].lower() == key.lower():
            values = [number_of(bare(word)) for word in words_of(front)]
            return None if None in values or not values else values
    return None


def _rosco(file, usual, air_density, radius, folders):
    """Return the Control of a ROSCO input file, versions 2.5 to 2.10."""
    if not _is_rosco(file):
        raise file.refusal("is not a file of ROSCO: PC_RefSpd, VS_RefSpd and VS_RtTq are missing")
    source = file.source

    def figure(key, *also, **limits):
        return file.number(key, *also, **limits), source(key)

    efficiency = usual["generator_efficiency"][0]
    if file.has("VS_GenEff"):
        efficiency = file.number("VS_GenEff", low=1.0, high=100.0) / 100.0
    torque, speed = file.positive("VS_RtTq", high=1e12), file.positive("PC_RefSpd", "VS_RefSpd", high=1e5)
    constant = file.positive("VS_Rgn2K", high=1e14)
    slowest = figure("VS_MinOMSpd", default=0.0, low=0.0, high=1e5)
    # the law of a turbine file needs a region 1 1/2, which ROSCO may have at zero speed
    if not 0.0 < slowest[0] < 0.85 * speed:
        slowest = 0.3 * speed, "30 % of rated speed: not in the deck"
    law = {
        "minimum_speed": slowest,
        "region2_constant": (constant, source("VS_Rgn2K")),
        "region3_min_pitch": figure("PC_Switch", default=0.01745, low=0.0, high=1.0),
        "max_torque": (max(file.positive("VS_MaxTq", default=1.1 * torque), torque), source("VS_MaxTq")),
        "max_torque_rate": (file.positive("VS_MaxRat", default=0.348 * torque), source("VS_MaxRat")),
        "speed_filter_corner": (
            file.positive("F_LPFCornerFreq", default=1.5708, high=1e3), source("F_LPFCornerFreq")
        ),
    }  # fmt: skip
    actuator = file.whole("PA_Mode", default=0)
    table = _optional(file, "PerfFileName", folders)
    performance = None if table is None else read_performance(table)
    wind = _rated_wind(file, torque * speed, air_density, radius, performance)
    low = figure("PC_MinPit", default=0.0, low=-1.0, high=1.0)
    high = figure("PC_MaxPit", default=0.5 * math.pi, low=-1.0, high=2.0 * math.pi)
    if high[0] <= low[0]:
        raise file.wrong("PC_MaxPit", high[0], f"> PC_MinPit = {low[0]:g}")
    why = f"PA_Mode of {file.path.name} acts inside ROSCO" if actuator else "the deck has no actuator"
    figures = {
        "generator_efficiency": (efficiency, source("VS_GenEff")),
        "rated_torque": (torque, source("VS_RtTq")),
        "rated_speed": (speed, source("PC_RefSpd")),
        "minimum_pitch": low,
        "maximum_pitch": high,
        "pitch_rate": (file.positive("PC_MaxRat", high=10.0), source("PC_MaxRat")),
        "rated_wind_speed": wind,
        "time_constant": (0.0, "no lag: " + why),
    }
    winds = _values(file, "WE_FOPoles_v") or _values(file, "PS_WindSpeeds") or []
    valid = len(winds) > 1 and 0.0 < winds[0] < wind[0] < winds[-1]
    for name, end in (("cut_in_wind_speed", 0), ("cut_out_wind_speed", -1)):
        figures[name] = winds[end] if valid else usual[name][0], source("WE_FOPoles_v")
    if actuator == 2:  # an actuator of second order
        figures["natural_frequency"] = file.positive("PA_CornerFreq", high=100.0), source("PA_CornerFreq")
        figures["damping"] = file.positive("PA_Damping", default=0.707, high=5.0), source("PA_Damping")
    return Control(figures, law, {}, tuple(_rosco_notes(file, actuator)), file, performance)


def _rosco_notes(file, actuator):
    """Yield the features of ROSCO that the torque law of the turbine file lacks."""
    mode = file.whole("VS_ControlMode", default=2)
    yield (
        f"ROSCO's torque law (VS_ControlMode {mode:g}, minimum speed VS_MinOMSpd)",
        "for the built-in controllers the law of regions 1 to 3: VS_Rgn2K above VS_MinOMSpd, a steep line"
        " below, and a line to VS_RtTq above region 2",
    )
    yield (
        "pitch gains from a table (PC_GS_angles, PC_GS_KP, PC_GS_KI)",
        "in the controller rosco, which runs the DISCON.IN; other controllers derive gains from the rotor",
    )
    if file.whole("PS_Mode", default=0):
        yield "peak shaving (PS_Mode)", "in the controller rosco only, which runs the DISCON.IN"
    if actuator:
        option = ", or the option pitch_drive = 'second_order'" if actuator == 2 else ""
        here = "pitch_drive.time_constant 0: set a value for other controllers" + option
        yield "pitch actuator within ROSCO (PA_Mode)", here
    if file.whole("IPC_ControlMode", default=0):
        yield "individual pitch control (IPC_ControlMode)", "collective pitch"


def _rated_wind(file, power, air_density, radius, performance):
    """Return (rated wind speed m/s, source): from ROSCO's tables, or rated power at the largest Cp."""
    ramp = _values(file, "IPC_Vramp")
    if ramp and len(ramp) > 1 and 5.0 < ramp[1] < 30.0:
        return ramp[1], file.source("IPC_Vramp, its second value")
    largest, name = 0.45, "a power coefficient of 0.45"
    if performance is not None and performance.largest is not None:
        largest = performance.largest
        name = f"the largest power coefficient {largest:.3f} of {performance.name}"
    reach = file.positive("WE_BladeRadius", default=radius)
    if reach is None:
        return 11.4, "estimate: radius unknown"
    speed = (power / (0.5 * air_density * math.pi * reach**2 * largest)) ** (1.0 / 3.0)
    return min(max(speed, 5.0), 20.0), f"rated power at {name}"
