"""Reports on an imported deck: key values, approximations, omissions, suggested wind and sea."""

from typing import NamedTuple

import numpy as np

from fowt_env.files.markdown import markdown_table
from fowt_env.files.openfast_deck.consistency import contradictions
from fowt_env.files.openfast_deck.conversion import ballast, hub_place, mass_properties, rotor_mass
from fowt_env.files.openfast_deck.hydrodyn import is_old

OPTIONS = {  # degree of freedom: (data of ElastoDyn that the plant has then, scene option)
    "first blade flap mode": ("structure", 'blades = "modes"'),
    "first blade edge mode": ("structure", 'blades = "modes"'),
    "second blade flap mode": ("structure", 'blades = "modes2"'),
    "drivetrain torsion": ("shaft", 'shaft = "torsion"'),
    "first fore-aft tower mode": ("bending", 'tower = "modes"'),
    "first side-to-side tower mode": ("bending", 'tower = "modes"'),
    "second fore-aft tower mode": ("bending", 'tower = "modes2"'),
    "second side-to-side tower mode": ("bending", 'tower = "modes2"'),
}


class Report(NamedTuple):
    """Holds the rows of a report's tables: figures (name, value), differences (deck, here), and others."""

    title: str
    figures: list
    differences: list
    contradictions: list  # (values in the deck, consequence)
    files: list
    suggestions: list


def make_report(deck, name, body=None):
    """Return the Report of a deck imported under a name; body: the deck's PotentialFlow, or None."""
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
    yield "platform inertia about this centre", ", ".join(f"{x:.5g}" for x in np.diag(inertia)) + " kg m2"
    if hydro.potential is not None:
        lift = deck.site.water_density * hydro.potential.volume - masses["total"]
        yield "displaced volume", f"{hydro.potential.volume:.6g} m3"
        yield "buoyancy less weight, balanced by lines and members", f"{lift / 1e3:,.1f} t".replace(",", " ")
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
    if deck.aerodyn.tower_influence:
        models = ", ".join(f"{option} = {model}" for option, model in deck.aerodyn.tower_influence.items())
        yield "influence of the tower on the wind", models
    yield "rated torque, speed", f"{control['rated_torque']:.6g} N m, {control['rated_speed']:.6g} rad/s"
    yield "rated wind speed", f"{control['rated_wind_speed']:.4g} m/s"


def _differences(deck):
    """Yield (feature of the deck, treatment in the plant) of all differences."""
    values, hydro = deck.elastodyn, deck.hydrodyn
    for what in values.flexible:
        part, option = OPTIONS.get(what, (None, None))
        available = part is not None and getattr(values, part) is not None
        yield what, f"rigid; with the option {option} as in the deck" if available else "rigid"
    yield from values.notes
    if any(values.platform_products):
        names = "PtfmXYIner, PtfmYZIner, PtfmXZIner"
        yield f"products of inertia of the platform ({names})", "left out: principal axes are the body axes"
    _, _, inertia = ballast(deck)
    across = np.abs(inertia - np.diag(np.diag(inertia))).max()
    if hydro.fills and across > 1e-3 * np.diag(inertia).min():
        what = "ballast water whose principal axes are not the body axes"
        yield what, f"products of inertia of {across:.3g} kg m2 left out"
    yield from deck.aerodyn.notes
    many = [(name, table) for name, table in deck.aerodyn.tables.items() if table[1] > 1]
    if many:
        name, (used, tables, reynolds) = many[0]
        here = f"one table each: number {used} (Reynolds number {reynolds} million)"
        yield f"{len(many)} polars with several tables, such as {tables} of {name}", here
    here = "a straight taper and one drag coefficient with the same load in uniform wind"
    yield "tower drag from a table over height (TwrDiam, TwrCd)", here
    if values["GBoxEff"] != 100.0:
        what = f"gearbox efficiency {values['GBoxEff']:g} % (GBoxEff)"
        yield what, "mesh_loss, the same fraction of the torque"
    yield from hydro.notes
    if hydro.fills and is_old(hydro.file):
        yield (
            "water in members without restoring, included in AddCLin (HydroDyn before OpenFAST 3)",
            "water whose weight moves with the platform; AddCLin less the restoring of the water",
        )
    if hydro.memory == 0 and hydro.potential is not None:
        yield "no memory of radiated waves (RdtnMod 0)", "radiation with memory"
    if hydro.memory == 2:
        yield "state-space fit of the radiation in a file (.ss)", "from the coefficients themselves"
    for key, value in hydro.second_order.items():
        if key == "DiffQTF" and value == 12:
            yield f"difference-frequency forces (DiffQTF {value})", "with the option second_order"
        elif key == "SumQTF" and value == 12:
            yield "sum-frequency forces (SumQTF 12)", 'with the option second_order = "full_sum"'
        else:
            yield f"second-order forces ({key} {value})", "left out"
    if any(end[0] for member in hydro.members for end in member.axial):
        here = "axial_drag_coefficient, on rho A |v| v / 2: half of AxCd"
        yield "axial drag of joints, on rho A |v| v / 4 in HydroDyn", here
    yield from deck.notes
    yield from deck.control.notes


def markdown(report):
    """Return the text of report.md."""
    parts = [
        f"# {report.title}",
        "Comments in `platform.toml` and `turbine/turbine.toml` name the file and the keys of each value.",
        "## Key values",
        markdown_table(("quantity", "value"), report.figures),
        "## Differences from the deck",
        markdown_table(("in the deck", "here"), report.differences),
    ]
    if report.contradictions:
        parts.append("## Contradictions in the deck")
        parts.append(markdown_table(("in the deck", "consequence"), report.contradictions))
    parts += [
        "## Wind and sea",
        "\n".join(f"- {line}" for line in report.suggestions),
        "## Files read",
        "\n".join(f"- `{row[0]}` and the files named there" for row in report.files),
    ]
    return "\n\n".join(parts) + "\n"
