"""Integrals of a tower that bends: closed forms, a beam of finite elements, OpenFAST's figures."""

import numpy as np
import pytest
from naive.beam import beam_frequencies

from fowt_env import build_scene
from fowt_env.analysis.check import check_platform
from fowt_env.analysis.tower_frequencies import bending
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.tower_modes import TowerBending
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.scene.beam import shape_values
from fowt_env.scene.mass import build_rigid_body, top_mass_matrix
from fowt_env.scene.tower import build_tower_modes, modes_asked

LINE, EI, BASE, TOP, BEARING = 1000.0, 1e10, 10.0, 60.0, 5000.0
UNIFORM = TowerBending(
    height_fraction=(0.0, 1.0), mass_density=(LINE, LINE), fore_aft_stiffness=(EI, EI),
    side_side_stiffness=(2.0 * EI, 2.0 * EI),
    fore_aft=((1.0, 0.0, 0.0, 0.0, 0.0), (-2.0, 3.0, 0.0, 0.0, 0.0)),
    side_side=((0.0, 1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 0.0)), fore_aft_damping=(0.01, 0.02),
    side_side_damping=(0.03, 0.04), fore_aft_tuner=(4.0, 9.0), top_mass=BEARING, elements=999,
)  # fmt: skip


def with_modes(platform, modes, **tower):
    """The platform with other modes and figures of its tower."""
    changed = platform.tower.model_copy(update={"modes": modes, **tower})
    return platform.model_copy(update={"tower": changed})


@pytest.fixture(scope="module")
def uniform():
    """(TowerModes of a uniform tower with two modes each way, mass of nacelle and rotor)."""
    platform = with_modes(read_platform("oc3_hywind"), UNIFORM, base_height=BASE, top_height=TOP)
    turbine = read_turbine("nrel5mw")
    return build_tower_modes(platform, turbine, 2, 15), turbine.nacelle.mass + turbine.rotor.mass


def test_a_uniform_tower_has_the_integrals_of_its_powers(uniform):
    """Fore-aft x^2 and 3 x^3 - 2 x^2, side-side x^3 and x^2, of the height fraction x."""
    found, carried = uniform
    length = TOP - BASE
    beam, fore_aft = found.beam, np.array([1.0, 0.0, 1.0, 0.0])
    assert (found.first, beam.mass, beam.first, beam.second) == (15, 0.0, 0.0, 0.0)
    assert found.slope * length == pytest.approx([2.0, 3.0, 5.0, 2.0])
    means = np.array([1 / 3, 1 / 4, 3 / 4 - 2 / 3, 1 / 3])  # of the shapes
    first = LINE * length * means + BEARING
    assert (beam.a, beam.b) == (
        pytest.approx(fore_aft * first, rel=3e-6),
        pytest.approx((1.0 - fore_aft) * first, rel=3e-6),
    )
    moments = BASE * means + length * np.array([1 / 4, 1 / 5, 3 / 5 - 2 / 4, 1 / 4])
    assert beam.e + beam.f == pytest.approx(LINE * length * moments + BEARING * TOP, rel=3e-6)
    assert beam.A[0, 0] == pytest.approx(LINE * length / 5 + BEARING, rel=3e-6)
    assert beam.C[0, 1] == pytest.approx(LINE * length / 6 + BEARING, rel=3e-6)
    assert beam.A[2, 2] == pytest.approx(LINE * length * (9 / 7 - 12 / 6 + 4 / 5) + BEARING, rel=3e-6)
    # curvatures 2, 6 x, 18 x - 4, 2 over the length squared; tuners 4 and 9
    stiffness = np.zeros((4, 4))
    stiffness[np.ix_((0, 2), (0, 2))] = [[4 * 4, 6 * 10], [6 * 10, 9 * 52]]
    stiffness[np.ix_((1, 3), (1, 3))] = [[2 * 12, 2 * 6], [2 * 6, 2 * 4]]
    assert beam.stiffness == pytest.approx(EI / length**3 * stiffness, rel=3e-6, abs=1e-3)
    # slopes 2 x, 3 x^2, 9 x^2 - 4 x, 2 x over the length
    first = (carried + BEARING) * 4 / 3 + LINE * length * 4 * (1 / 3 - 1 / 4)
    cross = (carried + BEARING) * 3 / 2 + LINE * length * 6 * (1 / 4 - 1 / 5)
    weight = beam.S0 + carried * found.shortening
    assert weight[0, 0] * length == pytest.approx(first, rel=3e-6)
    assert weight[1, 3] * length == pytest.approx(cross, rel=3e-6)
    assert not weight[0, 1] and not weight[2, 3]


def test_structural_damping_is_of_the_bare_tower(uniform):
    """ElastoDyn's: 2 zeta K / omega, omega of the second mode without weight and without mass on the top."""
    beam = uniform[0].beam
    for i, j, ratio, part in (
        (0, 0, 0.01, 1 / 5),
        (2, 0, 0.01, 1 / 5),
        (1, 1, 0.03, 1 / 7),
        (1, 3, 0.04, 1 / 5),
    ):
        omega = np.sqrt(beam.stiffness[j, j] / (LINE * (TOP - BASE) * part))
        assert beam.damping[i, j] == pytest.approx(2.0 * ratio * beam.stiffness[i, j] / omega, rel=3e-6)


def test_shapes_at_the_points_of_the_tower_drag_are_those_at_their_heights(uniform):
    scene = build_scene("oc3_hywind", wind=0.0, rotor="table", fidelity="reference")
    tower = scene.platform.tower
    found = build_tower_modes(scene.platform, scene.turbine, 1, 15)
    fraction = (scene.model.aero.tower.z - tower.base_height) / (tower.top_height - tower.base_height)
    shape = np.array(tower.modes.fore_aft[0])
    wanted = sum(a * fraction ** (k + 2) for k, a in enumerate(shape)) / shape.sum()
    assert found.drag_shape[:, 0] == pytest.approx(wanted, rel=1e-12)
    assert found.drag_shape.shape == (len(fraction), 2)
    assert shape_values(np.array([shape / shape.sum()]), [1.0])[0, 0] == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("name", ["iea15_volturnus_s", "nrel5mw_oc4_semi", "oc3_hywind"])
def test_clamped_with_its_turbine_a_tower_bends_as_a_beam_of_finite_elements(name):
    """A mode of given shape is stiffer than the beam: first modes by up to 0.2 %, as Rayleigh has it."""
    platform = read_platform(name)
    turbine, modes, tower = read_turbine(platform.turbine), platform.tower.modes, platform.tower
    top = top_mass_matrix(platform, turbine)
    arm = top[0, 4] / top[0, 0] - tower.top_height
    own = bending(platform, turbine, len(modes.fore_aft))
    whole = top[0, 0] + modes.top_mass
    for along, axis, stiffness in (
        (True, 4, modes.fore_aft_stiffness),
        (False, 3, modes.side_side_stiffness),
    ):
        height = arm + tower.top_height
        inertia = top[axis, axis] - top[0, 0] * (height**2 - arm**2)  # about the tower top
        first = beam_frequencies(
            tower.top_height - tower.base_height, modes.height_fraction, modes.mass_density, stiffness,
            (whole, top[0, 0] * arm / whole, inertia), platform.environment.gravity,
        )[0]  # fmt: skip
        rows = np.ix_(own.fore_aft == along, own.fore_aft == along)
        squares = np.linalg.eigvals(np.linalg.solve(own.mass[rows], own.stiffness[rows]))
        mine = np.sqrt(squares.real.min()) / (2.0 * np.pi)
        assert first * (1.0 - 1e-4) < mine < first * 1.002


def test_the_land_based_5_mw_tower_has_the_published_frequencies():
    """NREL/TP-500-38060, Table 9-1: 0.3240 Hz fore-aft, 0.3120 Hz side-side by FAST, whose blades bend.

    Its tower is that of the barge with other shapes. ADAMS has 0.3195 and 0.3164 Hz there.
    """
    platform = read_platform("nrel5mw_iti_barge")
    modes = platform.tower.modes.model_copy(
        update={
            "fore_aft": ((0.7004, 2.1963, -5.6202, 6.2275, -2.504),),
            "side_side": ((1.385, -1.7684, 3.0871, -2.2395, 0.5357),),
        }
    )
    own = bending(with_modes(platform, modes), read_turbine(platform.turbine), 1)
    frequencies = np.sqrt(np.diag(own.stiffness) / np.diag(own.mass)) / (2.0 * np.pi)
    assert frequencies == pytest.approx([0.3240, 0.3120], rel=0.05)


def test_on_volturnus_the_tower_bends_as_often_as_openfast_s():
    """Free decay of OpenFAST v5.0.0 with the first modes alone, rotor parked: 0.5180 Hz fore-aft."""
    platform = read_platform("iea15_volturnus_s")
    turbine, flow = read_turbine(platform.turbine), platform.potential_flow
    own = bending(platform, turbine, 1)
    rigid = build_rigid_body(platform, turbine)
    pitch = flow.stiffness.copy()
    pitch[3, 3] -= rigid.gravity * rigid.s_z
    pitch[4, 4] -= rigid.gravity * rigid.s_z
    whole = np.block([
        [rigid.mass_matrix + flow.added_mass_infinite, own.inertia], [own.inertia.T, own.mass]
    ])  # fmt: skip
    restoring = np.block([[pitch, own.weight], [own.weight.T, own.stiffness]])
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(whole, restoring)).real)
    side, along = np.sqrt(squares[-2:]) / (2.0 * np.pi)
    assert along == pytest.approx(platform.published["tower_frequency"], rel=0.002)
    assert side < along


def test_a_check_lists_the_frequencies_of_the_tower():
    found = check_platform("iea15_volturnus_s").tower
    assert list(found) == ["first fore-aft", "first side-side", "second fore-aft", "second side-side"]
    for name, low, high in (("first fore-aft", 0.3498, 0.5155), ("second side-side", 1.4464, 1.5105)):
        assert found[name] == pytest.approx((low, high), rel=2e-4)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"tower": "bends"}, ("tower = 'bends'", "'rigid', 'modes', 'modes2'")),
        ({"tower": "modes", "planar": True}, ("tower = 'modes'", "planar = False")),
    ],
)
def test_an_option_that_cannot_be_is_refused(options, words):
    with pytest.raises(InputError) as caught:
        modes_asked(build_scene("oc3_hywind", **{"fidelity": "reference"} | options).options)
    assert all(word in str(caught.value) for word in words)


def test_a_tower_without_the_modes_asked_for_is_refused():
    platform = read_platform("oc3_hywind")
    turbine, modes = read_turbine(platform.turbine), platform.tower.modes
    first = modes.model_copy(update={name: getattr(modes, name)[:1] for name in ("fore_aft", "side_side")})
    for changed, count, words in (
        (None, 1, ("'modes'", "no [tower.modes]", "allowed: 'rigid'")),
        (first, 2, ("'modes2'", "first modes alone", "allowed: 'rigid', 'modes'")),
    ):
        with pytest.raises(InputError) as caught:
            build_tower_modes(with_modes(platform, changed), turbine, count, 15)
        assert all(word in str(caught.value) for word in words)
    assert build_tower_modes(with_modes(platform, None), turbine, 0, 15) is None
