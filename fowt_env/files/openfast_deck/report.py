"""What became of a deck: figures, what is approximated, what is left out, how to go on."""

from typing import NamedTuple

import numpy as np

from fowt_env.files.markdown import markdown_table
from fowt_env.files.openfast_deck.consistency import contradictions
from fowt_env.files.openfast_deck.conversion import ballast, hub_place, mass_properties, rotor_mass
from fowt_env.files.openfast_deck.hydrodyn import is_old

TOWER_OPTIONS = {  # what a degree of freedom's name begins with: the option of a scene that has it
    "first fore-aft": 'tower = "modes"',
    "first side-to-side": 'tower = "modes"',
    "second fore-aft": 'tower = "modes2"',
    "second side-to-side": 'tower = "modes2"',
}


class Report(NamedTuple):
    """Rows of tables: figures (name, value), differences (deck, here), contradictions, files."""

    title: str
    figures: list
    differences: list
    contradictions: list  # (what the deck says, what follows)
    files: list
    suggestions: list


def make_report(deck, name, body=None):
    """Report of a deck imported under a name; body: its PotentialFlow, or None."""
    return Report(
        title=f"{name}: imported from {deck.name}",
        figures=list(_figures(deck, body)),
        differences=list(dict.fromkeys(_differences(deck))),
        contradictions=list(contradictions(deck, body)),
        files=[(path.name,) for path in deck.files],
        suggestions=[f"Sea of the deck: {deck.sea.words}.", f"Wind of the deck: {deck.inflow.words}."],
    )


def _figures(deck, body):
    masses, hydro, control = mass_properties(deck), deck.hydrodyn, deck.control
    for part, value in masses.items():
        if value or part == "total":
            yield f"mass, {part}", f"{value:,.1f} kg".replace(",", " ")
    overhang, height = hub_place(deck)
    _, centre, inertia = ballast(deck)
    yield "rotor inertia about the shaft", f"{rotor_mass(deck).inertia:.6g} kg m2"
    yield "hub height, overhang", f"{height:.3f} m, {overhang:.3f} m"
    yield "platform centre of mass", ", ".join(f"{x:.4g}" for x in centre) + " m"
    yield "platform inertia about it", ", ".join(f"{x:.5g}" for x in np.diag(inertia)) + " kg m2"
    if hydro.potential is not None:
        lift = deck.site.water_density * hydro.potential.volume - masses["total"]
        yield "displaced volume", f"{hydro.potential.volume:.6g} m3"
        yield "buoyancy less weight, which lines and members hold", f"{lift / 1e3:,.1f} t".replace(",", " ")
    if body is not None:
        low, high = body.omega[0], body.omega[-1]
        yield "radiation coefficients", f"{len(body.omega)} frequencies, {low:.3g} to {high:.3g} rad/s"
        yield "wave excitation", f"{len(body.excitation_omega)} frequencies, {len(body.heading)} headings"
        if body.difference_qtf is not None:
            shape = body.difference_qtf.value.shape
            yield "difference-frequency QTF", f"{shape[1]} frequencies, {shape[0]} pairs of headings"
    if hydro.members:
        inside = sum(member.potential_flow for member in hydro.members)
        yield "members", f"{len(hydro.members)}, {inside} of them in the potential-flow body"
    yield "mooring lines", str(len(deck.lines))
    yield "rated torque, speed", f"{control['rated_torque']:.6g} N m, {control['rated_speed']:.6g} rad/s"
    yield "rated wind speed", f"{control['rated_wind_speed']:.4g} m/s"


def _differences(deck):
    """(what the deck has, what the plant has) of everything that is not alike."""
    values, hydro = deck.elastodyn, deck.hydrodyn
    for what in values.flexible:
        option = next((option for word, option in TOWER_OPTIONS.items() if what.startswith(word)), None)
        known = values.bending is not None and option
        yield what, f"rigid; with the option {option} as in the deck" if known else "rigid"
    yield from values.notes
    if any(values.platform_products):
        names = "PtfmXYIner, PtfmYZIner, PtfmXZIner"
        yield f"products of inertia of the platform ({names})", "left out: its principal axes are the body's"
    _, _, inertia = ballast(deck)
    across = np.abs(inertia - np.diag(np.diag(inertia))).max()
    if hydro.fills and across > 1e-3 * np.diag(inertia).min():
        what = "ballast water whose principal axes are not the body's"
        yield what, f"products of inertia of {across:.3g} kg m2 left out"
    yield from deck.aerodyn.notes
    many = [(name, table) for name, table in deck.aerodyn.tables.items() if table[1] > 1]
    if many:
        name, (taken, tables, reynolds) = many[0]
        said = f"one table each: number {taken} (Reynolds number {reynolds} million)"
        yield f"{len(many)} polars of several tables, such as {tables} of {name}", said
    said = "a straight taper and one drag coefficient of the same load in even wind"
    yield "tower drag of a table over height (TwrDiam, TwrCd)", said
    if values["GBoxEff"] != 100.0:
        what = f"gearbox efficiency {values['GBoxEff']:g} % (GBoxEff)"
        yield what, "mesh_loss, the same part of the torque"
    yield from hydro.notes
    if hydro.fills and is_old(hydro.file):
        yield (
            "water in members that restores nothing, its moment in AddCLin (HydroDyn before OpenFAST 3)",
            "water whose weight turns with the platform; AddCLin less that moment",
        )
    if hydro.memory == 0 and hydro.potential is not None:
        yield "no memory of radiated waves (RdtnMod 0)", "radiation with its memory"
    if hydro.memory == 2:
        yield "state-space fit of the radiation in a file (.ss)", "from the coefficients themselves"
    for key, value in hydro.second_order.items():
        if key == "DiffQTF" and value == 12:
            yield f"difference-frequency forces (DiffQTF {value})", "with the option second_order"
        else:
            yield f"second-order forces ({key} {value})", "left out"
    if any(end[0] for member in hydro.members for end in member.axial):
        said = "axial_drag_coefficient, on rho A |v| v / 2: half of AxCd"
        yield "axial drag of joints, which HydroDyn has on rho A |v| v / 4", said
    yield from deck.notes
    yield from deck.control.notes


def markdown(report):
    """Text of report.md."""
    parts = [
        f"# {report.title}",
        "Figures of `platform.toml` and `turbine/turbine.toml` name the file and the keys they are from.",
        "## Key figures",
        markdown_table(("figure", "value"), report.figures),
        "## What is not as in the deck",
        markdown_table(("in the deck", "here"), report.differences),
    ]
    if report.contradictions:
        parts.append("## Where the deck contradicts itself")
        parts.append(markdown_table(("the deck", "what follows"), report.contradictions))
    parts += [
        "## Wind and sea",
        "\n".join(f"- {line}" for line in report.suggestions),
        "## Files read",
        "\n".join(f"- `{row[0]}` and what it names" for row in report.files),
    ]
    return "\n\n".join(parts) + "\n"
