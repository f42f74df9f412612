"""Detects contradictions within a deck, which also affect OpenFAST's simulation of the deck."""

import math

import numpy as np

ROOM = 20.0  # m of platform drift that a proposed wave grid covers
NEAR = 5e-3  # relative tolerance: rounding in decks
MOTIONS = ("surge", "sway", "heave", "roll", "platform pitch", "yaw")


def contradictions(deck, body=None):
    """Yield rows (values in the deck, consequence); body: the deck's PotentialFlow, or None."""
    yield from _wave_grid(deck)
    yield from _figures(deck)
    if body is not None:
        yield from _coefficients(body)


def _wave_grid(deck):
    """Yield contradictions of SeaState's wave grid with the members that the grid must cover."""
    water = deck.water
    wet = [np.array([member.start, member.end]) for member in deck.hydrodyn.members
           if min(member.start[2], member.end[2]) < 0.0]  # fmt: skip
    if not wet or not water.has("X_HalfWidth"):
        return
    ends = np.concatenate(wet)
    for axis, key in ((0, "X_HalfWidth"), (1, "Y_HalfWidth")):
        half, reach = water.positive(key), float(np.abs(ends[:, axis]).max())
        if half < reach:
            proposed = 5.0 * math.ceil((reach + ROOM) / 5.0)
            yield (
                f"a grid of waves up to {key} {half:g} m, members up to {reach:.4g} m",
                "here the wave at each member; OpenFAST uses the wave at the grid's edge outside: for a"
                f" comparison set {key} {proposed:g} m (members and {ROOM:g} m of drift)",
            )
    bottom, deepest = water.positive("Z_Depth", default=math.inf), -float(ends[:, 2].min())
    if bottom < deepest:
        yield (
            f"a grid of waves down to Z_Depth {bottom:g} m, members down to {deepest:.4g} m",
            "here the wave at each member; for a comparison with OpenFAST set Z_Depth"
            f" {math.ceil(deepest):g} m",
        )


def _figures(deck):
    """Yield contradictions of values that are given in two files."""
    site, values, aero = deck.site, deck.elastodyn, deck.aerodyn
    for file, key, used in (
        (deck.water, "WtrDpth", site.water_depth),
        (deck.water, "WtrDens", site.water_density),
        (aero.file, "AirDens", site.air_density),
    ):
        other = None if deck.fst is None else deck.fst.number(key, default=None)
        if other is not None and not _alike(used, other):
            yield f"{key} {used:g} in {file.kind}, {other:g} in the .fst", f"{used:g}"
    length, span = float(aero.blade[-1, 0]), values["TipRad"] - values["HubRad"]
    if not _alike(length, span):
        what = f"blade of {length:.5g} m in AeroDyn (BlSpn), {span:.5g} m in ElastoDyn (TipRad - HubRad)"
        yield what, "stations of AeroDyn, masses of ElastoDyn"
    top, height = float(aero.tower[-1, 0]) if len(aero.tower) > 1 else 0.0, values["TowerHt"]
    if aero.tower_loads and len(aero.tower) > 1 and not _alike(top, height, 0.02):
        what = f"tower up to {top:.5g} m in AeroDyn (TwrElev), {height:.5g} m in ElastoDyn (TowerHt)"
        yield what, "the tower of ElastoDyn"
    for key, actual, source in (
        ("WE_GearboxRatio", values["GBRatio"], "GBRatio of ElastoDyn"),
        ("WE_BladeRadius", values["TipRad"], "TipRad of ElastoDyn"),
        ("WE_RhoAir", site.air_density, site.sources["air_density"]),
    ):
        tuned = None if deck.control.discon is None else deck.control.discon.number(key, default=None)
        if tuned is not None and not _alike(tuned, actual):
            yield f"{key} {tuned:g} of ROSCO's wind estimator", f"the turbine has {actual:g} ({source})"


def _coefficients(body):
    """Yield implausible values of added mass and hydrostatic stiffness."""
    for motion, value in zip(MOTIONS, np.diag(body.added_mass_infinite), strict=True):
        if value < 0.0:
            what = f"added mass of {value:.4g} in {motion} at infinite frequency"
            yield what, "the same: added mass of a body is never negative; check WAMIT's .1"
    if not np.any(body.stiffness):
        effect = "the same: restoring from mooring lines and members only"
        yield "hydrostatic stiffness of zero (.hst)", effect


def _alike(a, b, near=NEAR):
    return abs(a - b) <= near * max(abs(a), abs(b))
