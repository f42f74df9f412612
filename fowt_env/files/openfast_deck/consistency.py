"""Where a deck contradicts itself, so that OpenFAST's own run of it is not what its author thinks."""

import math

import numpy as np

ROOM = 20.0  # m, by which a platform drifts: of the grid of waves that is proposed
NEAR = 5e-3  # of a figure: rounding in decks
MOTIONS = ("surge", "sway", "heave", "roll", "platform pitch", "yaw")


def contradictions(deck, body=None):
    """(what the deck says, what follows) rows; body: the deck's PotentialFlow, or None."""
    yield from _wave_grid(deck)
    yield from _figures(deck)
    if body is not None:
        yield from _coefficients(body)


def _wave_grid(deck):
    """Of SeaState's grid of waves and the members that it must reach."""
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
                "here the wave at each member; OpenFAST has that of the grid's edge beyond it: for a"
                f" comparison give {key} {proposed:g} m (members and {ROOM:g} m of drift)",
            )
    bottom, deepest = water.positive("Z_Depth", default=math.inf), -float(ends[:, 2].min())
    if bottom < deepest:
        yield (
            f"a grid of waves down to Z_Depth {bottom:g} m, members down to {deepest:.4g} m",
            "here the wave at each member; for a comparison with OpenFAST give Z_Depth"
            f" {math.ceil(deepest):g} m",
        )


def _figures(deck):
    """Of figures that two files have."""
    site, values, aero = deck.site, deck.elastodyn, deck.aerodyn
    for file, key, taken in (
        (deck.water, "WtrDpth", site.water_depth),
        (deck.water, "WtrDens", site.water_density),
        (aero.file, "AirDens", site.air_density),
    ):
        other = None if deck.fst is None else deck.fst.number(key, default=None)
        if other is not None and not _alike(taken, other):
            yield f"{key} {taken:g} in {file.kind}, {other:g} in the .fst", f"{taken:g}"
    own, span = float(aero.blade[-1, 0]), values["TipRad"] - values["HubRad"]
    if not _alike(own, span):
        what = f"blade of {own:.5g} m in AeroDyn (BlSpn), {span:.5g} m in ElastoDyn (TipRad - HubRad)"
        yield what, "stations of AeroDyn, masses of ElastoDyn"
    top, height = float(aero.tower[-1, 0]) if len(aero.tower) > 1 else 0.0, values["TowerHt"]
    if aero.tower_loads and len(aero.tower) > 1 and not _alike(top, height, 0.02):
        what = f"tower up to {top:.5g} m in AeroDyn (TwrElev), {height:.5g} m in ElastoDyn (TowerHt)"
        yield what, "the tower of ElastoDyn"
    for key, own, source in (
        ("WE_GearboxRatio", values["GBRatio"], "GBRatio of ElastoDyn"),
        ("WE_BladeRadius", values["TipRad"], "TipRad of ElastoDyn"),
        ("WE_RhoAir", site.air_density, site.sources["air_density"]),
    ):
        told = None if deck.control.discon is None else deck.control.discon.number(key, default=None)
        if told is not None and not _alike(told, own):
            yield f"{key} {told:g} of ROSCO's wind estimator", f"the turbine has {own:g} ({source})"


def _coefficients(body):
    """Of added mass and stiffness that no body has."""
    for motion, value in zip(MOTIONS, np.diag(body.added_mass_infinite), strict=True):
        if value < 0.0:
            what = f"added mass of {value:.4g} in {motion} at infinite frequency"
            yield what, "the same: a body's is never negative; look at WAMIT's .1"
    if not np.any(body.stiffness):
        said = "the same: nothing but lines and members restores the platform"
        yield "hydrostatic stiffness of zero (.hst)", said


def _alike(a, b, near=NEAR):
    return abs(a - b) <= near * max(abs(a), abs(b))
