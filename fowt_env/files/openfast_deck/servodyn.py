"""Controller of a deck: ServoDyn's file and the DISCON.IN of ROSCO or of the legacy 5 MW controller.

The figures are what a torque law and a pitch drive of this project need, all in SI on the high-speed shaft.
"""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fowt_env.files.openfast_deck.parser import PartFile, bare, number_of, words_of

RPM = math.pi / 30.0
MOST_SCHEDULE = 1000


@dataclass(frozen=True)
class Control:
    """Figures of the controller; sources: a comment for each name."""

    generator_efficiency: float
    rated_torque: float  # N m
    rated_speed: float  # rad/s
    cut_in_speed: float
    region2_start_speed: float
    region2_constant: float  # N m/(rad/s)^2
    transition_speed: float
    slip_percent: float
    region3_min_pitch: float  # rad
    max_torque: float
    max_torque_rate: float
    speed_filter_corner: float  # rad/s
    minimum_pitch: float  # rad
    maximum_pitch: float
    pitch_rate: float  # rad/s
    time_constant: float = 0.0  # s, of the pitch actuator
    rated_wind_speed: float | None = None
    cut_in_wind_speed: float = 3.0
    cut_out_wind_speed: float = 25.0
    gains: tuple | None = None  # KP (s), KI (-), pitch at which they are halved (rad)
    sources: dict = field(default_factory=dict)
    notes: tuple = ()
    discon: Path | None = None  # copied beside the turbine

    @property
    def rated_power(self):
        """Mechanical, W."""
        return self.rated_torque * self.rated_speed


# NREL 5 MW: constants of its DISCON source (OpenFAST/r-test), which reads no file
LEGACY_RATED_SPEED = 122.9096
LEGACY = {
    "rated_torque": 43093.55, "rated_speed": LEGACY_RATED_SPEED, "cut_in_speed": 70.16224,
    "region2_start_speed": 91.21091, "region2_constant": 2.332287, "transition_speed": 121.6805,
    "slip_percent": 10.0, "region3_min_pitch": 0.01745329, "max_torque": 47402.91,
    "max_torque_rate": 15000.0, "speed_filter_corner": 1.570796, "minimum_pitch": 0.0,
    "maximum_pitch": math.pi / 2.0, "pitch_rate": math.radians(8.0), "rated_wind_speed": 11.4,
}  # fmt: skip
LEGACY_GAINS = {True: (0.006275604, 0.0008965149, 0.1099965), False: (0.01882681, 0.008068634, 0.1099965)}


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
        notes += list(_left_out(servo))
    chosen = Path(discon) if discon is not None else None
    if chosen is None and servo is not None and servo.whole("VSContrl", default=0) != 1:
        chosen = (
            servo.other("DLL_InFile", folders=folders, default=None) if _has_file(servo, folders) else None
        )
    if chosen is not None:
        control = _rosco(chosen, efficiency, air_density, radius, folders)
    elif servo is None:
        control = _legacy(None, efficiency, gear_ratio)
    elif servo.whole("VSContrl", default=0) == 1:
        control = _simple(servo, efficiency)
    else:
        control = _legacy(servo, efficiency, gear_ratio)
    return replace(control, sources=sources | control.sources, notes=(*notes, *control.notes))


def _has_file(servo, folders):
    """Whether the file that DLL_InFile names is there: the legacy controllers name one that is not."""
    from fowt_env.files.openfast_deck.parser import locate

    name = servo.text("DLL_InFile", default="unused")
    return (
        locate(name, (servo.path.parent, *folders)) is not None
        if name.lower() not in ("", "unused")
        else False
    )


def _left_out(file):
    """What ServoDyn has and the plant does not."""
    for key, what in (
        ("NumBStC", "blades"),
        ("NumNStC", "nacelle"),
        ("NumTStC", "tower"),
        ("NumSStC", "platform"),
    ):
        if file.whole(key, default=0):
            yield f"structural controllers (tuned mass dampers) of the {what} ({key})", "none"
    for key, what in (("CompNTMD", "nacelle"), ("CompTTMD", "tower")):
        if file.flag(key, default=False):
            yield f"tuned mass damper of the {what} ({key})", "none"
    if file.whole("YCMode", default=0):
        yield "nacelle-yaw control (YCMode)", "the nacelle does not yaw"
    if file.whole("HSSBrMode", default=0):
        yield "shaft brake (HSSBrMode)", "none"
    if file.whole("CCmode", default=0):
        yield "cable control (CCmode)", "mooring lines of constant length"


def _legacy(servo, efficiency, gear_ratio):
    """Control of the NREL 5 MW turbine's own controller, known by its gear ratio; else refused."""
    library = "" if servo is None else servo.text("DLL_FileName", default="").lower()
    if not 96.0 <= gear_ratio <= 98.0 or (library and "discon" not in library):
        where = "the deck" if servo is None else f"ServoDyn file {str(servo.path)!r}"
        from fowt_env.errors import InputError

        raise InputError(
            f"{where}: DLL_InFile names no DISCON.IN that is there, and the torque law is not of VSContrl 1:"
            " give the DISCON.IN with --discon"
        )
    floating = "hywind" in library or "barge" in library or "tlp" not in library and "semi" in library
    text = "legacy controller of the NREL 5 MW turbine (source of its library)"
    names = {name: text for name in (*LEGACY, "gains")}
    notes = () if servo is not None else (
        ("no ServoDyn file", "torque law and limits of the NREL 5 MW turbine, by the gear ratio"),
    )  # fmt: skip
    return Control(efficiency, **LEGACY, gains=LEGACY_GAINS[floating], sources=names, notes=notes)


def _simple(servo, efficiency):
    """Control of ServoDyn's own simple variable speed."""
    speed = servo.number("VS_RtGnSp", low=0.0, high=1e5, open_low=True) * RPM
    torque = servo.number("VS_RtTq", low=0.0, high=1e12, open_low=True)
    constant = servo.number("VS_Rgn2K", low=0.0, high=1e14, open_low=True) / RPM**2
    slip = servo.number("VS_SlPc", low=0.0, high=100.0, open_low=True)
    law = _law(torque, speed, constant, 0.3 * speed, servo, slip)
    source = servo.source("VS_RtGnSp", "VS_RtTq", "VS_Rgn2K", "VS_SlPc")
    rate = servo.number("PitManRat(1)", default=8.0, low=0.0, high=90.0, open_low=True)
    return Control(
        efficiency, **law, region3_min_pitch=math.radians(1.0), max_torque=1.1 * torque,
        max_torque_rate=0.35 * torque, speed_filter_corner=0.25 * 2.0 * math.pi, minimum_pitch=0.0,
        maximum_pitch=0.5 * math.pi, pitch_rate=math.radians(rate),
        sources={name: source for name in (*law, "max_torque")} | {"pitch_rate": servo.source("PitManRat(1)")},
        notes=(("no limits of torque and pitch, no filter", "those of the NREL 5 MW turbine, scaled"),),
    )  # fmt: skip


def _law(torque, speed, constant, slowest, file, slip=10.0):
    """Speeds of the torque law: steep to the parabola about the slowest speed, and steep to the rated torque."""
    # the slip line of region 2.5 needs a parabola below the rated torque where it ends
    transition = min(0.99 * speed, 0.99 * math.sqrt(torque / constant))
    if not 0.0 < slowest < 0.85 * transition:
        slowest = 0.5 * transition
    return {
        "rated_torque": torque,
        "rated_speed": speed,
        "cut_in_speed": 0.9 * slowest,
        "region2_start_speed": 1.1 * slowest,
        "region2_constant": constant,
        "transition_speed": transition,
        "slip_percent": slip,
    }


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
    if not any(file.has(key) for key in ("PC_RefSpd", "VS_RefSpd", "VS_RtTq")):
        raise file.refusal("is not of ROSCO: PC_RefSpd, VS_RefSpd and VS_RtTq are missing")
    source = file.source
    efficiency_key = "VS_GenEff"
    if file.has(efficiency_key):
        efficiency = file.number(efficiency_key, low=1.0, high=100.0) / 100.0
    torque = file.number("VS_RtTq", low=0.0, high=1e12, open_low=True)
    speed = file.number("PC_RefSpd", "VS_RefSpd", low=0.0, high=1e5, open_low=True)
    constant = file.number("VS_Rgn2K", low=0.0, high=1e14, open_low=True)
    slowest = file.number("VS_MinOMSpd", default=0.0, low=0.0)
    law = _law(torque, speed, constant, slowest, file)
    notes = list(_rosco_notes(file, law))
    largest = file.number("VS_MaxTq", default=1.1 * torque, low=0.0, open_low=True)
    winds = _values(file, "WE_FOPoles_v") or _values(file, "PS_WindSpeeds") or []
    wind, how = _rated_wind(file, law, air_density, radius, folders)
    gains, words = _gains(file)
    notes += words
    sources = {
        "rated_torque": source("VS_RtTq"), "rated_speed": source("PC_RefSpd"),
        "region2_constant": source("VS_Rgn2K"),
        "cut_in_speed": f"0.9 of {source('VS_MinOMSpd')}", "region2_start_speed": f"1.1 of {source('VS_MinOMSpd')}",
        "transition_speed": f"{law['transition_speed'] / speed:.3f} of {source('PC_RefSpd')}: below"
        " where the parabola has the rated torque",
        "slip_percent": "a choice: region 2.5 is no part of ROSCO's law",
        "region3_min_pitch": source("PC_Switch"), "max_torque": source("VS_MaxTq"),
        "max_torque_rate": source("VS_MaxRat"), "speed_filter_corner": source("F_LPFCornerFreq"),
        "minimum_pitch": source("PC_MinPit"), "maximum_pitch": source("PC_MaxPit"),
        "pitch_rate": source("PC_MaxRat"), "rated_wind_speed": how, "gains": source("PC_GS_angles", "PC_GS_KP", "PC_GS_KI"),
        "time_constant": "followed at once: " + ("PA_Mode of " + path.name + " acts inside ROSCO"
                          if file.whole("PA_Mode", default=0) else "the deck has no actuator"),
        "generator_efficiency": source(efficiency_key),
        "cut_in_wind_speed": source("WE_FOPoles_v"), "cut_out_wind_speed": source("WE_FOPoles_v"),
    }  # fmt: skip
    low = file.number("PC_MinPit", default=0.0, low=-1.0, high=1.0)
    high = file.number("PC_MaxPit", default=0.5 * math.pi, low=-1.0, high=2.0 * math.pi)
    if high <= low:
        raise file.wrong("PC_MaxPit", high, f"> PC_MinPit = {low:g}")
    control = Control(
        efficiency, **law,
        region3_min_pitch=file.number("PC_Switch", default=0.01745, low=0.0, high=1.0),
        max_torque=max(largest, torque),
        max_torque_rate=file.number("VS_MaxRat", default=0.3 * torque, low=0.0, open_low=True),
        speed_filter_corner=file.number("F_LPFCornerFreq", default=1.5708, low=0.0, high=1e3, open_low=True),
        minimum_pitch=low, maximum_pitch=high,
        pitch_rate=abs(file.number("PC_MaxRat", low=0.0, high=10.0, open_low=True)),
        rated_wind_speed=wind, gains=gains, sources=sources, notes=tuple(notes), discon=file.path,
    )  # fmt: skip
    if len(winds) > 1 and 0.0 < winds[0] < wind < winds[-1]:
        control = replace(control, cut_in_wind_speed=winds[0], cut_out_wind_speed=winds[-1])
    return control


def _rosco_notes(file, law):
    """What the plain torque law of the turbine file has not, of ROSCO's."""
    yield (
        "ROSCO's torque law (VS_ControlMode {:g}, minimum speed VS_MinOMSpd)".format(
            file.whole("VS_ControlMode", default=2)
        ),
        "for the built-in controllers, the law of regions 1 to 3: parabola VS_Rgn2K from 1.1 VS_MinOMSpd, steep"
        f" lines to zero at 0.9 VS_MinOMSpd and to VS_RtTq at {law['transition_speed']:.4g} rad/s",
    )
    if file.whole("PS_Mode", default=0):
        yield "peak shaving (PS_Mode)", "in the controller rosco alone, which runs the DISCON.IN"
    if file.whole("PA_Mode", default=0):
        yield (
            "pitch actuator within ROSCO (PA_Mode)",
            "pitch_drive.time_constant 0: set it for other controllers",
        )
    if file.whole("IPC_ControlMode", default=0):
        yield "individual pitch control (IPC_ControlMode)", "collective pitch"


def _rated_wind(file, law, air_density, radius, folders):
    """(m/s, where it is from): of ROSCO's own tables, or of power and the largest power coefficient."""
    ramp = _values(file, "IPC_Vramp")
    if ramp and len(ramp) > 1 and 5.0 < ramp[1] < 30.0:
        return ramp[1], file.source("IPC_Vramp, its second value")
    largest, name = 0.45, "a power coefficient of 0.45"
    table = file.other("PerfFileName", folders=folders, default=None) if _there(file, folders) else None
    if table is not None:
        found = _largest_power_coefficient(table)
        if found is not None:
            largest, name = found, f"the largest power coefficient {found:.3f} of {table.name}"
    power = law["rated_torque"] * law["rated_speed"]
    reach = file.number("WE_BladeRadius", default=radius, low=0.0, open_low=True)
    if reach is None:
        return 11.4, "a guess: no radius is known"
    speed = (power / (0.5 * air_density * math.pi * reach**2 * largest)) ** (1.0 / 3.0)
    return min(max(speed, 5.0), 20.0), f"rated power at {name}"


def _there(file, folders):
    from fowt_env.files.openfast_deck.parser import locate

    name = file.text("PerfFileName", default="unused")
    return (
        locate(name, (file.path.parent, *folders)) is not None
        if name.lower() not in ("", "unused")
        else False
    )


def _largest_power_coefficient(path):
    """Largest value of the first table of ROSCO's rotor performance file, or None."""
    file = PartFile(path, "rotor performance")
    best, inside = None, False
    for text in file.lines:
        if "power coefficient" in text.lower():
            inside = True
        elif "thrust coefficient" in text.lower():
            break
        elif inside and not text.lstrip().startswith("#"):
            values = [number_of(word) for word in text.split()]
            good = [value for value in values if value is not None and value < 0.6]
            best = max([*good, best or 0.0])
    return best if best and best > 0.2 else None


def _gains(file):
    """((KP, KI, pitch of half gain) or None, notes): one schedule 1/(1 + pitch/that) through ROSCO's table."""
    names = ("PC_GS_angles", "PC_GS_KP", "PC_GS_KI")
    angle, kp, ki = (np.array(_values(file, name) or []) for name in names)
    if not (1 <= len(angle) <= MOST_SCHEDULE) or len(angle) != len(kp) or len(angle) != len(ki):
        return None, [("no schedule of pitch gains (PC_GS_KP)", "no gains: give them, or tune a controller")]
    if not (ki < 0.0).all() or kp[0] >= 0.0:
        return None, [("pitch gains of another sign (PC_GS_KP)", "no gains: give them, or tune a controller")]
    if len(angle) == 1:
        return (float(-kp[0]), float(-ki[0]), 10.0), []
    slope, start = np.polyfit(angle, -1.0 / ki, 1)
    if slope <= 0.0 or start <= 0.0:
        return (float(-kp.mean()), float(-ki.mean()), 10.0), []
    half = start / slope
    shape = 1.0 / (1.0 + angle / half)
    proportional = float((shape @ -kp) / (shape @ shape))
    if proportional <= 0.0:
        return None, [("pitch gains of another sign (PC_GS_KP)", "no gains: give them, or tune a controller")]
    worst = float(np.abs(shape * proportional + kp).max() / np.abs(kp).max())
    words = (
        f"pitch gains from a table (PC_GS_angles, {len(angle)} rows)",
        f"one schedule KP/(1 + pitch/{half:.4g}): KP within {100.0 * worst:.0f} % of its largest; the table is"
        " in the DISCON.IN, which the controller rosco runs",
    )
    return (proportional, 1.0 / float(start), float(half)), [words]
