"""Reads sea and wind of a deck: SeaState (formerly part of HydroDyn) and InflowWind."""

import math
from typing import NamedTuple

from fowt_env.descriptions.wind_files import read_uniform_wind
from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.keys import differences
from fowt_env.files.openfast_deck.parser import PartFile, bare

LEAST_CUT = (0.5, 4.0)  # times the peak frequency: 0.5 % of the variance of a JONSWAP sea lie outside
SEAS = {
    "3": "white noise", "4": "a user's spectrum", "5": "external elevations", "6": "external kinematics",
    "7": "a user's components",
}  # fmt: skip
WINDS = {3: "TurbSim", 4: "Bladed", 5: "HAWC", 6: "user-defined", 7: "Bladed"}


class Sea(NamedTuple):
    """Defines the waves of a deck as a scene's sea argument, or describes why there is none."""

    suggestion: dict | None  # sea argument of a scene
    words: str
    notes: tuple = ()  # (feature of the deck, treatment in the plant)


class Inflow(NamedTuple):
    """Defines the wind of a deck by its shear exponent, and describes the wind in words."""

    shear_exponent: float | None
    words: str
    notes: tuple = ()  # (feature of the deck, treatment in the plant)


def read_sea(file):
    """Read the Sea from SeaState's file, or from HydroDyn's file before OpenFAST 4. Raises: InputError."""
    more = list(_current(file))
    entry = file.find("WaveMod")
    kind = bare(entry[1][0]).lower() if entry else "0"
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
        named = SEAS.get(kind[:1], "an unknown kind of sea")
        suggestion, words = None, f"{named} (WaveMod {kind}): set the sea with the option sea"
    if suggestion and heading:
        suggestion["heading"] = heading
        words += f", heading {heading:g} deg"
    return Sea(suggestion, "; ".join([words, *more]), tuple(differences(file)))


def _current(file):
    """Yield a description of the current, if the deck has a current."""
    if file.one_of("CurrMod", (0, 1), default=0, why="2, a user's current, cannot be represented") == 0:
        return
    speeds = {key: file.number(key, default=0.0) for key in ("CurrSSV0", "CurrNSV0", "CurrDIV")}
    if any(speeds.values()):
        listed = [f"{key} {value:g} m/s" for key, value in speeds.items()]
        keys = ("CurrSSDir", "CurrNSRef", "CurrNSDir", "CurrDIDir")
        listed += [f"{key} {file.text(key, default='0')}" for key in keys]
        yield f"current ({', '.join(listed)}): set it with the option current"


def _jonswap(file, more):
    """Return (suggestion, words) of a random sea; a note on cut-off frequencies is appended to `more`."""
    height, period = (file.number(key, low=0.0) for key in ("WaveHs", "WaveTp"))
    peak = file.number("WavePkShp", default=None, low=1.0, high=7.0)
    low, high = file.number("WvLowCOff", default=0.0), file.number("WvHiCOff", default=math.inf)
    middle = 2.0 * math.pi / max(period, 1e-6)  # frequency of the peak
    if low > LEAST_CUT[0] * middle or high < LEAST_CUT[1] * middle:
        more.append(f"cut off below {low:g} and above {high:g} rad/s (WvLowCOff, WvHiCOff): no cut-off here")
    suggestion = {"kind": "jonswap", "Hs": height, "Tp": period}
    words = f"JONSWAP, Hs {height:g} m, Tp {period:g} s"
    return (suggestion, words) if peak is None else (suggestion | {"gamma": peak}, f"{words}, gamma {peak:g}")


def read_inflow(path, folders=()):
    """Read the Inflow from an InflowWind file."""
    file = PartFile(path, "InflowWind")
    kind = file.whole("WindType")
    exponent = None
    if kind == 1:
        speed = file.number("HWindSpeed", low=0.0, high=100.0)
        exponent = file.number("PLexp", "PLExp", default=None, low=0.0, high=1.0)
        height = file.number("RefHt", default=0.0)
        words = f"steady, {speed:g} m/s at {height:g} m, power law {exponent or 0.0:g}"
    elif kind == 2:
        try:  # the wind file is optional
            name = file.other("Filename_Uni", "Filename", folders=folders, default="unused")
            if name is None:
                words = "uniform wind without a file name"
            else:
                exponent = read_uniform_wind(name)["shear_exponent"]
                height = file.number("RefHt_Uni", "RefHt", default=0.0)
                words = f"uniform wind of {name.name} at {height:g} m, which --wind applies at hub height"
        except InputError as error:
            words = f"uniform wind that cannot be used: {error}"
    else:
        words = f"{WINDS.get(kind, 'unknown')} (WindType {kind}): set the wind with --wind"
    return Inflow(exponent, words, tuple(differences(file)))
