"""Sea and wind of a deck: SeaState or the part of HydroDyn that it was, and InflowWind."""

import math
from typing import NamedTuple

from fowt_env.descriptions.wind_files import read_uniform_wind
from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare

LEAST_CUT = (0.5, 4.0)  # times the peak frequency: 0.5 % of the variance of a JONSWAP sea lie beyond
SEAS = {
    "3": "white noise", "4": "a user's spectrum", "5": "external elevations", "6": "external kinematics",
    "7": "a user's components",
}  # fmt: skip
WINDS = {3: "TurbSim", 4: "Bladed", 5: "HAWC", 6: "user-defined", 7: "Bladed"}


class Sea(NamedTuple):
    """Waves of a deck as this project takes them, or in words why not."""

    suggestion: dict | None  # sea argument of a scene
    words: str
    notes: tuple = ()  # (what the deck has, what the plant has)


class Inflow(NamedTuple):
    """Wind of a deck: the exponent of its shear, and words."""

    shear_exponent: float | None
    words: str
    notes: tuple = ()  # (what the deck has, what the plant has)


def read_sea(file):
    """Sea of SeaState's file, or of HydroDyn's of FAST 8. Raises: InputError."""
    more = list(_current(file))
    found = file.find("WaveMod")
    kind = bare(found[1][0]).lower() if found else "0"
    heading = file.number("WaveDir", default=0.0) if kind not in ("0", "6") else 0.0
    if kind == "0":
        suggestion, words = {"kind": "still"}, "still water (WaveMod 0)"
    elif kind == "2":
        suggestion, words = _jonswap(file, more)
    elif kind.startswith("1"):
        height, period = (file.number(key, low=0.0) for key in ("WaveHs", "WaveTp"))
        suggestion = {"kind": "regular", "H": height, "T": period}
        words = f"regular waves, H {height:g} m, T {period:g} s"
    else:
        named = SEAS.get(kind[:1], "a kind of its own")
        suggestion, words = None, f"{named} (WaveMod {kind}): give a sea of your own"
    if suggestion and heading:
        suggestion["heading"] = heading
        words += f", heading {heading:g} deg"
    return Sea(suggestion, "; ".join([words, *more]), tuple(differences(file)))


def _current(file):
    """Words on the current, if there is one."""
    if file.one_of("CurrMod", (0, 1), default=0, why="2, a user's current, cannot be represented") == 0:
        return
    speeds = {key: file.number(key, default=0.0) for key in ("CurrSSV0", "CurrNSV0", "CurrDIV")}
    if any(speeds.values()):
        listed = [f"{key} {value:g} m/s" for key, value in speeds.items()]
        keys = ("CurrSSDir", "CurrNSRef", "CurrNSDir", "CurrDIDir")
        listed += [f"{key} {file.text(key, default='0')}" for key in keys]
        yield f"current ({', '.join(listed)}): give it with the option current"


def _jonswap(file, more):
    """(suggestion, words) of a random sea; more: list to which words on its cut are added."""
    height, period = (file.number(key, low=0.0) for key in ("WaveHs", "WaveTp"))
    peak = file.number("WavePkShp", default=None, low=1.0, high=7.0)
    low, high = file.number("WvLowCOff", default=0.0), file.number("WvHiCOff", default=math.inf)
    middle = 2.0 * math.pi / max(period, 1e-6)  # frequency of the peak
    if low > LEAST_CUT[0] * middle or high < LEAST_CUT[1] * middle:
        more.append(f"cut off below {low:g} and above {high:g} rad/s (WvLowCOff, WvHiCOff): not here")
    suggestion = {"kind": "jonswap", "Hs": height, "Tp": period}
    words = f"JONSWAP, Hs {height:g} m, Tp {period:g} s"
    return (suggestion, words) if peak is None else (suggestion | {"gamma": peak}, f"{words}, gamma {peak:g}")


def read_inflow(path, folders=()):
    """Inflow of an InflowWind file."""
    file = PartFile(path, "InflowWind")
    kind = file.whole("WindType")
    exponent = None
    if kind == 1:
        speed = file.number("HWindSpeed", low=0.0, high=100.0)
        exponent = file.number("PLexp", "PLExp", default=None, low=0.0, high=1.0)
        height = file.number("RefHt", default=0.0)
        words = f"steady, {speed:g} m/s at {height:g} m, power law {exponent or 0.0:g}"
    elif kind == 2:
        try:  # the wind is a suggestion: without its file there is none
            name = file.other("Filename_Uni", "Filename", folders=folders, default="unused")
            if name is None:
                words = "uniform wind, its file is not named"
            else:
                exponent = read_uniform_wind(name)["shear_exponent"]
                height = file.number("RefHt_Uni", "RefHt", default=0.0)
                words = f"uniform wind of {name.name} at {height:g} m, which --wind takes at the hub's height"
        except InputError as error:
            words = f"uniform wind that cannot be taken over: {error}"
    else:
        words = f"{WINDS.get(kind, 'unknown')} (WindType {kind}): give the wind with --wind"
    return Inflow(exponent, words, tuple(differences(file)))
