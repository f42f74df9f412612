"""Where a deck contradicts itself, so that OpenFAST's own run of it is not what its author thinks."""

import math

import numpy as np

ROOM = 20.0  # m, by which a platform drifts: of the grid of waves that is proposed
NEAR = 5e-3  # of a figure: rounding in decks
MOTIONS = ("surge", "sway", "heave", "roll", "platform pitch", "yaw")


def contradictions(deck, body=None):
    """(what the deck says, what follows) rows; body: the deck's PotentialFlow, or None."""
    yield from _wave_grid(deck)
    yield from _site(deck)
    yield from _turbine(deck)
    yield from _controller(deck)
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
        half, reach = water.number(key, low=0.0, open_low=True), float(np.abs(ends[:, axis]).max())
        if half < reach:
            proposed = 5.0 * math.ceil((reach + ROOM) / 5.0)
            yield (
                f"a grid of waves up to {key} {half:g} m, members up to {reach:.4g} m",
                "here the wave at each member; OpenFAST has that of the grid's edge beyond it: for a"
                f" comparison give {key} {proposed:g} m (members and {ROOM:g} m of drift)",
            )
    bottom = water.number("Z_Depth", default=math.inf, low=0.0, open_low=True)
    deepest = -float(ends[:, 2].min())
    if bottom < deepest:
        yield (
            f"a grid of waves down to Z_Depth {bottom:g} m, members down to {deepest:.4g} m",
            "here the wave at each member; for a comparison with OpenFAST give Z_Depth"
            f" {math.ceil(deepest):g} m",
        )


def _site(deck):
    """Of figures that the .fst and a module both have."""
    if deck.fst is None:
        return
    for file, key, taken in (
        (deck.water, "WtrDpth", deck.site.water_depth),
        (deck.water, "WtrDens", deck.site.water_density),
        (deck.aerodyn.file, "AirDens", deck.site.air_density),
    ):
        other = deck.fst.number(key, default=None)
        if file is not deck.fst and other is not None and not _alike(taken, other):
            yield f"{key} {taken:g} in {file.kind}, {other:g} in the .fst", f"{taken:g}"


def _turbine(deck):
    """Of the lengths of blade and tower, which ElastoDyn and AeroDyn both have."""
    values, aero = deck.elastodyn, deck.aerodyn
    span = values["TipRad"] - values["HubRad"]
    if not _alike(float(aero.span[-1]), span):
        yield (
            f"blade of {aero.span[-1]:.5g} m in AeroDyn (BlSpn), {span:.5g} m in ElastoDyn (TipRad - HubRad)",
            "stations of AeroDyn, masses of ElastoDyn",
        )
    if aero.tower_loads and len(aero.tower) > 1:
        top = float(aero.tower[-1, 0])
        if not _alike(top, values["TowerHt"], 0.02):
            yield (
                f"tower up to {top:.5g} m in AeroDyn (TwrElev), {values['TowerHt']:.5g} m in ElastoDyn"
                " (TowerHt)",
                "the tower of ElastoDyn",
            )


def _controller(deck):
    """Of what ROSCO is told of the turbine."""
    file, values = deck.control.discon, deck.elastodyn
    if file is None:
        return
    for key, own, source in (
        ("WE_GearboxRatio", values["GBRatio"], "GBRatio of ElastoDyn"),
        ("WE_BladeRadius", values["TipRad"], "TipRad of ElastoDyn"),
        ("WE_RhoAir", deck.site.air_density, deck.site.sources["air_density"]),
    ):
        told = file.number(key, default=None)
        if told is not None and not _alike(told, own):
            yield f"{key} {told:g} of ROSCO's wind estimator", f"the turbine has {own:g} ({source})"


def _coefficients(body):
    """Of added mass that no body has."""
    for motion, value in zip(MOTIONS, np.diag(body.added_mass_infinite), strict=True):
        if value < 0.0:
            yield (
                f"added mass of {value:.4g} in {motion} at infinite frequency",
                "the same: a body's is never negative; look at WAMIT's .1",
            )
    if not np.any(body.stiffness):
        yield (
            "hydrostatic stiffness of zero (.hst)",
            "the same: nothing but lines and members restores the platform",
        )


def _alike(a, b, near=NEAR):
    return abs(a - b) <= near * max(abs(a), abs(b))
