"""Site, sea and wind of a deck: SeaState or the part of HydroDyn that it was, and InflowWind."""

import math
from dataclasses import dataclass, replace

from fowt_env.descriptions.wind_files import read_uniform_wind
from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare

LEAST_CUT = (0.5, 4.0)  # times the peak frequency: 0.5 % of the variance of a JONSWAP sea lie beyond


@dataclass(frozen=True)
class Sea:
    """Waves of a deck as this project takes them, or in words why not."""

    suggestion: dict | None  # sea argument of a scene
    words: str
    notes: tuple = ()  # (what the deck has, what the plant has)


@dataclass(frozen=True)
class Inflow:
    """Wind of a deck: a suggestion for the argument, the exponent of the shear, and words."""

    suggestion: float | None
    shear_exponent: float | None
    words: str
    notes: tuple = ()  # (what the deck has, what the plant has)


def read_sea(file):
    """Sea of SeaState's file, or of HydroDyn's of FAST 8. Raises: InputError."""
    current = file.one_of("CurrMod", (0, 1), default=0, why="2, a user's current, cannot be represented")
    more = []
    if current == 1:
        speeds = {key: file.number(key, default=0.0) for key in ("CurrSSV0", "CurrNSV0", "CurrDIV")}
        if any(speeds.values()):
            listed = [f"{key} {value:g} m/s" for key, value in speeds.items()]
            for key in ("CurrSSDir", "CurrNSRef", "CurrNSDir", "CurrDIDir"):
                listed.append(f"{key} {file.text(key, default='0')}")
            more.append(f"current ({', '.join(listed)}): give it with the option current")
    found = file.find("WaveMod")
    kind = bare(found[1][0]).lower() if found else "0"
    heading = file.number("WaveDir", default=0.0) if kind not in ("0", "6") else 0.0
    suggestion = None
    if kind == "0":
        suggestion, words = {"kind": "still"}, "still water (WaveMod 0)"
    elif kind.startswith("1") or kind == "2":
        height, period = (file.number(key, low=0.0) for key in ("WaveHs", "WaveTp"))
        if kind == "2":
            peak = file.number("WavePkShp", default=None, low=1.0, high=7.0)
            suggestion = {"kind": "jonswap", "Hs": height, "Tp": period}
            words = f"JONSWAP, Hs {height:g} m, Tp {period:g} s"
            if peak is not None:
                suggestion["gamma"] = peak
                words += f", gamma {peak:g}"
        else:
            suggestion = {"kind": "regular", "H": height, "T": period}
            words = f"regular waves, H {height:g} m, T {period:g} s"
        low, high = file.number("WvLowCOff", default=0.0), file.number("WvHiCOff", default=math.inf)
        if kind == "2":
            middle = 2.0 * math.pi / max(period, 1e-6)  # frequency of the peak
            if low > LEAST_CUT[0] * middle or high < LEAST_CUT[1] * middle:
                more.append(f"cut off below {low:g} and above {high:g} rad/s (WvLowCOff, WvHiCOff): not here")
        if heading:
            suggestion["heading"] = heading
            words += f", heading {heading:g} deg"
    else:
        names = {"3": "white noise", "4": "a user's spectrum", "5": "external elevations",
                 "6": "external kinematics", "7": "a user's components"}  # fmt: skip
        words = f"{names.get(kind[:1], 'a kind of its own')} (WaveMod {kind}): give a sea of your own"
    return Sea(suggestion, "; ".join([words, *more]), tuple(differences(file)))


def read_inflow(path, folders=()):
    """Inflow of an InflowWind file."""
    file = PartFile(path, "InflowWind")
    return replace(_inflow(file, folders), notes=tuple(differences(file)))


def _inflow(file, folders):
    """Inflow without notes."""
    kind = file.whole("WindType")
    if kind == 1:
        speed = file.number("HWindSpeed", low=0.0, high=100.0)
        exponent = file.number("PLexp", "PLExp", default=None, low=0.0, high=1.0)
        height = file.number("RefHt", default=0.0)
        return Inflow(
            speed, exponent, f"steady, {speed:g} m/s at {height:g} m, power law {exponent or 0.0:g}"
        )
    if kind == 2:
        try:  # the wind is a suggestion: without its file there is none
            name = file.other("Filename_Uni", "Filename", folders=folders, default="unused")
            if name is None:
                return Inflow(None, None, "uniform wind, its file is not named")
            exponent = read_uniform_wind(name)["shear_exponent"]
        except InputError as error:
            return Inflow(None, None, f"uniform wind that cannot be taken over: {error}")
        height = file.number("RefHt_Uni", "RefHt", default=0.0)
        return Inflow(
            None,
            exponent,
            f"uniform wind of {name.name} at {height:g} m, which --wind takes at the hub's height",
        )
    names = {3: "TurbSim", 4: "Bladed", 5: "HAWC", 6: "user-defined", 7: "Bladed"}
    return Inflow(None, None, f"{names.get(kind, 'unknown')} (WindType {kind}): give the wind with --wind")
