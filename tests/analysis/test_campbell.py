"""Natural frequencies over the rotor speed: OpenFAST's linearisation, published ones, closed forms."""

import numpy as np
import pytest

from fowt_env.analysis.campbell import Campbell, _Turbine, campbell
from fowt_env.analysis.tower_frequencies import bending
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import RPM
from fowt_env.errors import InputError
from fowt_env.scene.blade_beam import blade_beam

# OpenFAST v5.0.0, ElastoDyn alone on the tower of VolturnUS-S, without gravity; generator at the rotor speed,
# all modes damped by 8 % so that the rotor comes to rest in its frame; eigenvalues of the linearisation in
# multi-blade coordinates. At 0 and at 7.56 rpm, then at 7.56 rpm with a blade pitch of 15 deg: Hz and ratios
ELASTODYN = {
    (0.0, 0.0): (
        (0.34471, 0.02322), (0.34534, 0.02352), (0.53465, 0.07610), (0.54355, 0.08001), (0.57047, 0.07987),
        (0.67397, 0.05773), (0.74006, 0.07909), (0.75580, 0.07997), (1.53524, 0.07114), (1.61119, 0.08116),
        (1.63172, 0.08241), (2.56312, 0.07814), (2.69043, 0.10482), (7.84305, 0.04826),
    ),
    (7.56, 0.0): (
        (0.34111, 0.02830), (0.34520, 0.02277), (0.44734, 0.09087), (0.58551, 0.07731), (0.62410, 0.09354),
        (0.68251, 0.05793), (0.68955, 0.06130), (0.87983, 0.06798), (1.47087, 0.07965), (1.65701, 0.08116),
        (1.72373, 0.07089), (2.56814, 0.07817), (2.69508, 0.10471), (7.84419, 0.04827),
    ),
    (7.56, 15.0): (
        (0.34109, 0.02767), (0.34539, 0.02319), (0.44566, 0.09196), (0.57764, 0.07405), (0.62384, 0.09278),
        (0.68922, 0.06194), (0.69530, 0.06157), (0.87861, 0.06740), (1.47397, 0.07989), (1.64139, 0.08152),
        (1.72558, 0.07081), (2.55650, 0.07849), (2.73370, 0.10418), (7.92258, 0.04867),
    ),
}  # fmt: skip
# NREL/TP-500-38060, Table 9-1: FAST, the 5 MW turbine on land, rotor and generator locked
PUBLISHED = {
    "first fore-aft tower": 0.3240, "first side-side tower": 0.3120, "drivetrain torsion": 0.6205,
    "first flapwise, regressive": 0.6664, "first flapwise, progressive": 0.6675,
    "first flapwise, collective": 0.6993, "first edgewise, regressive": 1.0793,
    "first edgewise, progressive": 1.0898, "second flapwise, regressive": 1.9223,
    "second flapwise, progressive": 1.9337, "second flapwise, collective": 2.0205,
    "second fore-aft tower": 2.9003, "second side-side tower": 2.9361,
}  # fmt: skip


@pytest.fixture(scope="module")
def iea15():
    """(platform, turbine) of the IEA 15 MW turbine."""
    return read_platform("iea15_volturnus_s"), read_turbine("iea15")


def damped(platform, turbine, ratio):
    """Both with one damping ratio, without gravity, and with the generator's inertia in the nacelle's."""
    modes = platform.tower.modes.model_copy(
        update={"fore_aft_damping": (ratio,) * 2, "side_side_damping": (ratio,) * 2}
    )
    site = platform.environment.model_copy(update={"gravity": 0.0})
    tower = platform.tower.model_copy(update={"modes": modes})
    blade = turbine.blade_structure.model_copy(update={"damping_ratio": (ratio,) * 3})
    # ElastoDyn keeps the locked generator beside the nacelle, whose inertia in the files has it
    roll, *others = turbine.nacelle.inertia
    inertia = (roll + turbine.drivetrain.generator_inertia, *others)
    nacelle = turbine.nacelle.model_copy(update={"inertia": inertia})
    return (
        platform.model_copy(update={"tower": tower, "environment": site}),
        turbine.model_copy(update={"blade_structure": blade, "nacelle": nacelle}),
    )


@pytest.mark.parametrize("speed, pitch", ELASTODYN)
def test_frequencies_and_damping_are_those_of_openfasts_linearisation(iea15, speed, pitch):
    found = campbell(*damped(*iea15, 0.08), [speed * RPM], generator="fixed", blade_pitch=np.radians(pitch))
    mine = sorted((found.frequency[mode][0], found.damping[mode][0], mode) for mode in found.frequency)
    wanted = ELASTODYN[speed, pitch]
    assert len(mine) == len(wanted)
    for (hertz, ratio, mode), (theirs, theirs_ratio) in zip(mine, wanted, strict=True):
        # roll of the nacelle couples these three; their cause of 0.3 % was not found
        rolls = mode in ("first edgewise, collective", "second side-side tower", "drivetrain torsion")
        assert hertz == pytest.approx(theirs, rel=3e-3 if rolls else 4e-4), mode
        assert ratio == pytest.approx(theirs_ratio, rel=4e-3), mode


def test_the_centrifugal_load_bends_the_coned_blades_as_in_openfast(iea15):
    machine = _Turbine(*iea15, "modes2", "rigid", "rigid", "fixed", 0.0)
    # states of ElastoDyn of the linearisation above: flap 1, flap 2, edge 1
    assert machine.steady_deflection(7.56 * RPM) == pytest.approx([0.7081, -0.05087, 0.0532], rel=2e-3)
    assert not machine.steady_deflection(0.0).any()


def test_the_load_on_a_bent_turning_blade_is_the_slope_of_its_kinetic_energy(iea15):
    machine = _Turbine(*iea15, "modes2", "rigid", "rigid", "fixed", 0.3)
    q, none = np.array([6.0, -2.0, 3.0]), np.zeros(3)
    w = 0.9 * machine.blade_axes(0).T @ machine.shaft
    (shape, _, shorter), z, mass = machine.nodes.shapes, machine.nodes.z, machine.nodes.mass

    def energy(q):
        p = np.array([q @ shape[:, 0], q @ shape[:, 1], z - 0.5 * np.einsum("i,ijk,j->k", q, shorter, q)])
        return 0.5 * mass @ (np.cross(w, p.T) ** 2).sum(axis=1)

    slope = [(energy(q + step) - energy(q - step)) / 2e-3 for step in 1e-3 * np.eye(3)]
    load = machine.blade(q, none, none, none, w, none)[0] - machine.beam.stiffness @ q
    assert load == pytest.approx(-np.array(slope), rel=1e-5)


def test_tower_hub_and_a_free_generator_act_on_each_other_alike():
    platform, turbine = read_platform("nrel5mw_iti_barge"), read_turbine("nrel5mw_tilted")
    mass = _Turbine(platform, turbine, "rigid", "modes2", "torsion", "free", 0.0).linear(1.0)[0]
    assert np.abs(mass - mass.T).max() < 1e-9 * np.abs(mass[:5, :5]).max()
    assert np.abs(mass[5, 1]) > 1e5  # of the generator and the second coordinate, side-side


def test_the_land_based_5_mw_turbine_has_the_published_frequencies():
    """Within 0.7 %; the second asymmetric flapwise pair within 2.5 %: there the nacelle yaws on a spring."""
    platform, turbine = read_platform("nrel5mw_iti_barge"), read_turbine("nrel5mw_tilted")
    modes = platform.tower.modes.model_copy(
        update={
            "fore_aft": (
                (0.7004, 2.1963, -5.6202, 6.2275, -2.504), (-70.5319, -63.7623, 289.737, -176.513, 22.0706),
            ),
            "side_side": (
                (1.385, -1.7684, 3.0871, -2.2395, 0.5357), (-121.21, 184.415, -224.904, 298.536, -135.838),
            ),
        }
    )  # fmt: skip
    platform = platform.model_copy(update={"tower": platform.tower.model_copy(update={"modes": modes})})
    found = campbell(platform, turbine, [0.0], generator="fixed").frequency
    for mode, hertz in PUBLISHED.items():
        yaws = mode.startswith("second flapwise,") and "collective" not in mode
        assert found[mode][0] == pytest.approx(hertz, rel=0.025 if yaws else 0.007), mode


def test_a_rotor_alone_has_blade_frequencies_and_these_less_and_plus_1p(iea15):
    speeds = RPM * np.array([0.0, 5.0, 7.56])
    parts = damped(*iea15, 0.0)
    found = campbell(*parts, speeds, tower="rigid", shaft="rigid", generator="fixed").frequency
    beam = blade_beam(iea15[1], "modes2")
    squares = np.linalg.eigvals(np.linalg.solve(beam.A + beam.B, beam.stiffness))
    rest = np.sort(np.sqrt(squares.real)) / (2.0 * np.pi)
    # rated: a blade that turns about an axis across it, straight, of ElastoDyn's integrals
    rated = (0.56714, 0.74581, 1.63753)
    for name, at_rest, at_rated in zip(
        ("first flapwise", "first edgewise", "second flapwise"), rest, rated, strict=True
    ):
        alone = found[f"{name}, collective"]
        assert alone[0] == pytest.approx(at_rest, rel=1e-9)
        assert alone[2] == pytest.approx(at_rated, rel=1e-3)
        assert found[f"{name}, regressive"] == pytest.approx(alone - speeds / (2.0 * np.pi), rel=1e-9)
        assert found[f"{name}, progressive"] == pytest.approx(alone + speeds / (2.0 * np.pi), rel=1e-9)


@pytest.mark.parametrize("name, known", [("nrel5mw", 2.222), ("iea15", 31.09)])
def test_the_shaft_twists_between_two_inertias_or_against_one(name, known):
    platform, turbine = read_platform("iea15_volturnus_s"), read_turbine(name)
    stiffness, rotor = turbine.shaft_torsion.stiffness, turbine.rotor.inertia
    generator = turbine.drivetrain.gear_ratio**2 * turbine.drivetrain.generator_inertia
    for kind, compliance in (("free", 1.0 / rotor + 1.0 / generator), ("fixed", 1.0 / rotor)):
        found = campbell(platform, turbine, [1.0], blades="rigid", tower="rigid", generator=kind)
        hertz = np.sqrt(stiffness * compliance) / (2.0 * np.pi)
        assert found.frequency["drivetrain torsion"][0] == pytest.approx(hertz, rel=1e-12)
        damping = 0.5 * turbine.shaft_torsion.damping / stiffness * 2.0 * np.pi * hertz
        assert found.damping["drivetrain torsion"][0] == pytest.approx(damping, rel=1e-9)
        assert kind == "fixed" or hertz == pytest.approx(known, rel=0.01)


def test_a_tower_with_a_rigid_rotor_at_rest_bends_as_with_one_body_on_its_top(iea15):
    parts = damped(*iea15, 0.0)
    found = campbell(*parts, [0.0], blades="rigid", shaft="rigid", generator="fixed").frequency
    own = bending(*parts, 2)
    squares = np.linalg.eigvals(np.linalg.solve(own.mass, own.stiffness))
    assert sorted(each[0] for each in found.values()) == pytest.approx(
        np.sort(np.sqrt(squares.real)) / (2.0 * np.pi), rel=1e-9
    )
    turning = campbell(*parts, [1.0], blades="rigid", shaft="rigid", generator="fixed").frequency
    assert turning["first fore-aft tower"][0] != pytest.approx(found["first fore-aft tower"][0], rel=1e-5)


def test_a_mode_crosses_a_harmonic_where_the_lines_meet():
    speeds = np.array([0.0, 1.0, 2.0])
    found = Campbell(speeds, {"one": np.array([0.3, 0.3, 0.3]), "two": np.full(3, 9.0)}, {})
    assert found.crossings(3) == [("one", pytest.approx(0.3 * 2.0 * np.pi / 3.0))]
    assert found.crossings(6) == [("one", pytest.approx(0.3 * 2.0 * np.pi / 6.0))]


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"blades": "bend"}, ("blades", "modes, modes2, rigid")),
        ({"generator": "off"}, ("generator", "fixed, free")),
        ({"rotor_speeds": [1.0, 0.5]}, ("rotor_speeds: must increase",)),
        ({"rotor_speeds": [-1.0]}, ("rotor_speeds: must be one or more numbers >= 0",)),
        ({"blades": "rigid", "tower": "rigid", "shaft": "rigid"}, ("must have a mode",)),
        ({"blade_pitch": 4.0}, ("blade_pitch = 4",)),
    ],
)
def test_what_cannot_be_computed_is_refused(iea15, changes, words):
    settings = {"rotor_speeds": [0.5]} | changes
    with pytest.raises(InputError) as caught:
        campbell(*iea15, **settings)
    assert all(word in str(caught.value) for word in words)


def test_parts_without_data_are_refused(iea15):
    platform, scaled = iea15[0], read_turbine("liu_1_50")
    with pytest.raises(InputError, match=r"\[blade_structure\]"):
        campbell(platform, scaled, [1.0], shaft="rigid")
    with pytest.raises(InputError, match=r"\[shaft_torsion\]"):
        campbell(platform, scaled, [1.0], blades="rigid")
    pair = iea15[1].model_copy(update={"rotor": iea15[1].rotor.model_copy(update={"blades": 2})})
    with pytest.raises(InputError, match="rotor.blades = 2: must be 3"):
        campbell(platform, pair, [1.0])
