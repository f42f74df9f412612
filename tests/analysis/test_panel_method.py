"""Coefficients of a panel mesh against closed forms and the theory's own relations."""

import numpy as np
import pytest

from fowt_env.descriptions.potential_flow import coefficient_arrays, read_coefficients
from fowt_env.errors import InputError
from fowt_env.weather.waves import wave_number

pytest.importorskip("capytaine", reason='Capytaine is not installed: pip install "fowt-env[hydro]"')
from fowt_env.analysis.panel_method import _body, _hydrostatics, solve_mesh

RHO, G, DEPTH = 1025.0, 9.81, 200.0
RADIUS, DRAFT = 5.0, 30.0
OMEGA, HEADING = np.array([0.4, 0.8]), np.radians(np.arange(-180.0, 181.0, 30.0))


def write_mesh(path, x, y, z, inside_out=False):
    """WAMIT's .gdf of a surface over two parameters, (rows, columns) each."""
    panels = []
    for i in range(x.shape[0] - 1):
        for j in range(x.shape[1] - 1):
            corners = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
            panels.append([(x[c], y[c], z[c]) for c in (corners[::-1] if inside_out else corners)])
    lines = ["a surface", "1.0 9.81", "0 0", str(len(panels))]
    lines += [" ".join(f"{v:.9g}" for v in point) for panel in panels for point in panel]
    path.write_text("\n".join(lines) + "\n")
    return path


def cylinder(path, **options):
    """A vertical cylinder through the water line, closed below."""
    around = np.linspace(0.0, 2.0 * np.pi, 25)
    r = np.r_[np.zeros(1), RADIUS / 2.0, np.full(16, RADIUS)]
    z = np.r_[-DRAFT, -DRAFT, -DRAFT * np.linspace(1.0, 0.0, 16)]
    return write_mesh(
        path, np.outer(r, np.cos(around)), np.outer(r, np.sin(around)), np.outer(z, np.ones(25)), **options
    )


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    path = cylinder(tmp_path_factory.mktemp("mesh") / "spar.gdf")
    return solve_mesh(path, OMEGA, HEADING, water_depth=DEPTH, water_density=RHO, gravity=G)


POLYGON = 24.0 / (2.0 * np.pi) * np.sin(2.0 * np.pi / 24.0)  # area of 24 sides over that of the circle


def test_volume_and_stiffness_are_those_of_the_cylinder_of_24_sides(body):
    area = POLYGON * np.pi * RADIUS**2
    assert body.volume == pytest.approx(area * DRAFT, rel=1e-6)
    assert body.draft == pytest.approx(DRAFT)
    assert body.stiffness[2, 2] == pytest.approx(RHO * G * area, rel=1e-6)
    roll = RHO * G * (np.pi * RADIUS**4 / 4.0 - area * DRAFT * DRAFT / 2.0)
    assert body.stiffness[3, 3] == pytest.approx(roll, rel=2e-3)
    assert np.abs(body.centre_of_buoyancy) == pytest.approx(0.0, abs=1e-6)


def wedge(path, corners, fine=40):
    """A hull with vertical sides and a flat keel below a quadrilateral; corners to the left."""
    corner = np.asarray(corners, dtype=float)

    def between(a, b, n):
        return a + np.outer(np.linspace(0.0, 1.0, n + 1), b - a)

    low, high = between(corner[0], corner[1], fine), between(corner[3], corner[2], fine)
    keel = np.array([between(a, b, fine) for a, b in zip(low, high, strict=True)])
    rim = np.concatenate([between(a, b, 4)[:-1] for a, b in zip(corner, np.roll(corner, -1, 0), strict=True)])
    rim = np.vstack([rim, rim[:1]])
    side = np.array([[(*point, z) for point in rim] for z in (-DRAFT, -DRAFT / 2.0, 0.0)])
    keel = np.dstack([keel, np.full(keel.shape[:2], -DRAFT)])
    files = (write_mesh(path, *np.moveaxis(part, 2, 0)) for part in (keel, side))
    heads, panels = zip(*(file.read_text().split("\n", 4)[3:] for file in files), strict=True)
    head = ["a surface", "1.0 9.81", "0 0", str(sum(map(int, heads)))]
    path.write_text("\n".join(head) + "\n" + "".join(panels))
    return path


def moment_of_area(corners, p, q):
    """Integral of x^p y^q, to second order, over a quadrilateral: mid-sides of its two triangles."""
    total = 0.0
    for a, b, c in ((0, 1, 2), (0, 2, 3)):
        one, two, three = (np.asarray(corners[i], dtype=float) for i in (a, b, c))
        area = 0.5 * np.linalg.det(np.column_stack([two - one, three - one]))
        middles = 0.5 * np.array([one + two, two + three, three + one])
        total += area * np.mean(middles[:, 0] ** p * middles[:, 1] ** q)
    return total


def test_a_hull_beside_the_origin_has_the_stiffness_of_its_water_plane(tmp_path):
    """Integrals over it, buoyancy at its centre; and as Capytaine's own hydrostatics has it."""
    import capytaine as cpt

    corners = [(4.0, 3.0), (16.0, 1.0), (14.0, 12.0), (6.0, 9.0)]
    path = wedge(tmp_path / "wedge.gdf", corners)
    mesh = _body(cpt, path, lid=False).mesh
    volume, centre, stiffness = _hydrostatics(mesh, RHO, G)
    area, ax, ay, axy, axx, ayy = (
        moment_of_area(corners, *powers) for powers in ((0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2))
    )
    down = -area * DRAFT * DRAFT / 2.0
    expected = np.zeros((6, 6))
    expected[2, 2:5] = area, ay, -ax
    expected[3, 3:6] = ayy + down, -axy, -ax * DRAFT
    expected[4, 4:6] = axx + down, -ay * DRAFT
    expected[3:5, 2], expected[4, 3] = expected[2, 3:5], expected[3, 4]
    assert volume == pytest.approx(area * DRAFT, rel=1e-6)
    assert centre == pytest.approx([ax / area, ay / area, -DRAFT / 2.0], rel=1e-4)
    # panels of a fortieth of the sides, each with its area at its middle: (1/40)^2 of the moments
    assert stiffness == pytest.approx(RHO * G * expected, rel=1e-3)
    dofs = cpt.rigid_body_dofs(rotation_center=(0.0, 0.0, 0.0))
    theirs = cpt.FloatingBody(mesh=mesh, dofs=dofs, center_of_mass=(0.0, 0.0, 0.0))
    theirs = theirs.compute_hydrostatic_stiffness(rho=RHO, g=G).values
    assert stiffness[:, :5] == pytest.approx(theirs[:, :5], rel=1e-6, abs=1e-3)


def test_added_mass_across_is_the_displaced_mass_in_long_waves_and_less_in_short_ones(body):
    """Strip theory has the displaced mass; a surface without pressure takes some of it at high frequency."""
    displaced = RHO * body.volume
    assert body.added_mass[0, 0, 0] == pytest.approx(displaced, rel=0.1)
    assert 0.5 * displaced < body.added_mass_infinite[0, 0] < body.added_mass[0, 0, 0]


def test_long_waves_lift_by_the_stiffness_and_push_by_the_acceleration(body):
    """Signs and phases of the convention: heave leads to +C33, surge to +i times a positive force."""
    heave, surge = body.excitation[0, 6, 2], body.excitation[0, 6, 0]  # heading 0
    k = wave_number(OMEGA[:1], DEPTH, G)[0]
    # a slender hull under a wave of the keel's depth is one that moves against the water
    held = body.stiffness[2, 2] - OMEGA[0] ** 2 * body.added_mass[0, 2, 2]
    assert heave.real == pytest.approx(held * np.exp(-k * DRAFT), rel=0.01)
    assert surge.imag > 0.0 and abs(surge.real) < 0.05 * surge.imag
    inertia = 2.0 * RHO * np.pi * RADIUS**2 * G * (1.0 - np.exp(-k * DRAFT))
    assert surge.imag == pytest.approx(inertia, rel=0.1)
    assert body.excitation[0, 0, 0] == pytest.approx(-surge, rel=1e-6)  # from behind


def test_damping_follows_from_the_excitation_by_haskind_and_newman(body):
    """B_ii = k / (8 pi rho g c_g) times the integral of |X_i|^2 over all headings."""
    k = wave_number(OMEGA, DEPTH, G)
    group = 0.5 * OMEGA / k * (1.0 + 2.0 * k * DEPTH / np.sinh(2.0 * k * DEPTH))
    square = np.abs(body.excitation[:, :-1, :]) ** 2  # both ends of the circle are one heading
    integral = square.mean(axis=1) * 2.0 * np.pi
    expected = k[:, None] / (8.0 * np.pi * RHO * G * group[:, None]) * integral
    for motion in (0, 2):
        assert body.damping[:, motion, motion] == pytest.approx(expected[:, motion], rel=0.03)


def test_its_arrays_survive_a_file(body, tmp_path):
    path = tmp_path / "hydro.npz"
    np.savez_compressed(path, **coefficient_arrays(body))
    again = read_coefficients(path)
    assert again.excitation == pytest.approx(body.excitation, rel=1e-6)
    assert again.added_mass == pytest.approx(body.added_mass, rel=1e-6, abs=1.0)


@pytest.mark.parametrize(
    ("omega", "words"), [([0.5, 0.4], "must increase"), ([0.0, 0.4], "> 0"), ([1e-3], "must be > 0.02")]
)
def test_frequencies_that_cannot_be_solved_are_refused(tmp_path, omega, words):
    with pytest.raises(InputError, match=words):
        solve_mesh(cylinder(tmp_path / "spar.gdf"), omega, [0.0], water_depth=DEPTH)


def test_a_file_that_is_no_mesh_and_one_inside_out_are_refused(tmp_path):
    path = tmp_path / "spar.gdf"
    with pytest.raises(InputError, match="does not exist"):
        solve_mesh(path, OMEGA, [0.0], water_depth=DEPTH)
    path.write_text("no mesh\n")
    with pytest.raises(InputError, match="cannot be read"):
        solve_mesh(path, OMEGA, [0.0], water_depth=DEPTH)
    with pytest.raises(InputError, match="normals must point out"):
        solve_mesh(cylinder(path, inside_out=True), OMEGA, [0.0], water_depth=DEPTH)
