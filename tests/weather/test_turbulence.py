import numpy as np
import pytest
from naive.turbulence import disk_grid, pair_averages, veers

from fowt_env.descriptions.iec import etm_sigma, length_scale, ntm_sigma
from fowt_env.weather.turbulence import (
    amplitudes,
    centre_average,
    coherence_wave_number,
    disk_average,
    disk_gradient,
    fft_length,
    hub_turbulence,
    kaimal_spectrum,
    turbulence,
)

pytestmark = pytest.mark.installation

NREL5MW = {"height": 90.0, "diameter": 126.0}
SPEED = 18.0
SIGMA = ntm_sigma(SPEED, "B")


def band_variance(value, step, low, high):
    """Variance of a series' Fourier components with low <= f < high Hz."""
    n = len(value)
    frequency = np.fft.rfftfreq(n, step)
    power = 2.0 * np.abs(np.fft.rfft(value)) ** 2 / n**2
    return power[(frequency >= low) & (frequency < high)].sum()


def test_normal_turbulence_has_the_tabulated_deviation():
    # IEC 61400-1 NTM, values worked out in the project's reference table (three decimals)
    speeds = [8.0, 11.4, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0]
    table = {
        "A": [1.856, 2.264, 2.336, 2.576, 2.816, 3.056, 3.296, 3.536, 3.776],
        "B": [1.624, 1.981, 2.044, 2.254, 2.464, 2.674, 2.884, 3.094, 3.304],
        "C": [1.392, 1.698, 1.752, 1.932, 2.112, 2.292, 2.472, 2.652, 2.832],
    }
    for turbulence_class, row in table.items():
        found = [ntm_sigma(speed, turbulence_class) for speed in speeds]
        np.testing.assert_allclose(found, row, atol=5.1e-4)


def test_extreme_turbulence_deviation_worked_by_hand():
    # class I-B at 18 m/s: 2 * 0.14 * (0.072 * (10/2 + 3) * (18/2 - 4) + 10) = 0.28 * 12.88
    assert etm_sigma(18.0, "B", "I") == pytest.approx(3.6064, rel=1e-12)


def test_length_scale_stops_growing_at_60_m():
    assert [length_scale(z) for z in (30.0, 60.0, 90.0)] == pytest.approx([21.0, 42.0, 42.0])


def test_kaimal_spectrum_integrates_to_its_variance():
    frequency = np.geomspace(1e-7, 1e4, 20_001)
    area = np.trapezoid(kaimal_spectrum(frequency, SPEED, SIGMA, 340.2) * frequency, np.log(frequency))
    assert area == pytest.approx(SIGMA**2, rel=1e-3)  # 6e-4 of it lies above 1e4 Hz or below 1e-7 Hz


def test_point_series_has_the_kaimal_spectrum_and_its_deviation():
    """Bands of many bins, so the target is the integral of the density, times the small rescaling."""
    step, kept = 0.1, []
    for seed in range(5):
        period, value = turbulence(
            SPEED, SIGMA, **NREL5MW, period=720.0, seed=seed, average="point", step=step
        )
        assert value[:-1].std(axis=0)[:3] == pytest.approx(SIGMA * np.array([1.0, 0.8, 0.5]), rel=1e-9)
        assert np.abs(value[:-1].mean(axis=0)).max() < 1e-12
        assert np.all(value[:, 3:] == 0.0)
        kept.append(value[:-1])
    bin_width = 1.0 / period
    for column, (length, ratio) in enumerate(
        zip(42.0 * np.array([8.1, 2.7, 0.66]), (1.0, 0.8, 0.5), strict=True)
    ):
        inside = 1.0 - (1.0 + 6.0 * 5.0 * length / SPEED) ** (-2 / 3)
        inside -= 1.0 - (1.0 + 6.0 * 0.5 * bin_width * length / SPEED) ** (-2 / 3)
        for low, high in ((10, 40), (40, 150), (150, 700), (700, 2800)):
            edges = (np.array([low, high]) - 0.5) * bin_width
            frequency = np.linspace(*edges, 4001)
            target = np.trapezoid(kaimal_spectrum(frequency, SPEED, ratio * SIGMA, length), frequency)
            found = np.mean([band_variance(v[:, column], step, *edges) for v in kept])
            # the band's share of what fits between 1/period and the Nyquist frequency; 2e-3 for the
            # half bin that is lost at that frequency
            assert found == pytest.approx(target / inside, rel=2e-3)


@pytest.mark.parametrize("kr", [0.05, 0.3, 1.0, 3.0, 10.0, 40.0])
def test_disk_averages_equal_those_of_random_pairs(kr):
    average, average_error, gradient, gradient_error = pair_averages(kr, np.random.default_rng(7))
    assert abs(disk_average(kr) - average) < 4.0 * average_error  # 4 standard errors of the twin
    assert abs(disk_gradient(kr) - gradient) < 4.0 * gradient_error
    assert average_error < 0.02 * average  # the comparison means something


def test_disk_averages_have_their_known_limits():
    assert disk_average(1e-3) == pytest.approx(1.0, abs=1e-3)
    # mean distance of two points of a disk: 128 R/(45 pi)
    assert disk_average(2e-3) == pytest.approx(1.0 - 2e-3 * 128.0 / (45.0 * np.pi), abs=3e-6)
    # short correlation: 2 pi/k^2 of the disk's area, less its rim; gradient 4 times that as <z z> = 1/4
    assert disk_average(5e3) == pytest.approx(2.0 / 5e3**2 - 8.0 / np.pi / 5e3**3, rel=1e-5)
    assert disk_gradient(5e3) == pytest.approx(4.0 * disk_average(5e3), rel=1e-3)
    x = np.geomspace(1e-3, 1e4, 500)
    assert np.all(np.diff(disk_average(x)) < 0.0)


def test_rotor_average_and_gradient_equal_a_synthesis_on_points():
    """Veers on 208 points: deviations and spectra in bands of disk average and fitted gradients.

    The points' own error is removed by comparing frequencies at which a grid of 8 m still resolves
    the coherence (f < 0.25 Hz, 97 % of the averaged variance); what is left is statistics.
    """
    radius, period, records = 63.0, 300.0, 60
    points = disk_grid(radius, 8.0)
    assert len(points) > 150
    frequency = np.arange(1, 75) / period
    variance = kaimal_spectrum(frequency, SPEED, SIGMA, 340.2) / period
    found = veers(points, frequency, variance, SPEED, 340.2, np.random.default_rng(11), records)
    y, z = points.T
    series = {
        "mean": found.mean(axis=2),
        "vertical": (found * z).sum(axis=2) / (z * z).sum() * 2.0 * radius,  # per diameter
        "horizontal": (found * y).sum(axis=2) / (y * y).sum() * 2.0 * radius,
    }
    kr = coherence_wave_number(frequency, SPEED, 90.0) * radius
    target = {
        "mean": variance * disk_average(kr),
        "vertical": variance * 4.0 * disk_gradient(kr),
        "horizontal": variance * 4.0 * disk_gradient(kr),
    }
    for name, amplitude in series.items():
        power = 0.5 * np.abs(amplitude) ** 2  # (records, n)
        for low, high in ((0, 4), (4, 10), (10, 25), (25, 74), (0, 74)):
            samples = power[:, low:high].sum(axis=1)
            error = samples.std() / np.sqrt(records)
            wanted = target[name][low:high].sum()
            # 4 standard errors, and 3 % for the 8 m grid's own averaging
            assert abs(samples.mean() - wanted) < 4.0 * error + 0.03 * wanted, (name, low, high)
    # the means of u, vertical and horizontal shear are independent, as the generator takes them
    cross = np.mean(series["mean"] * np.conj(series["vertical"]))
    scale = np.sqrt(np.mean(np.abs(series["mean"]) ** 2) * np.mean(np.abs(series["vertical"]) ** 2))
    assert abs(cross) < 0.05 * scale


def test_a_vanishing_rotor_feels_the_point_and_no_gradient():
    point = turbulence(SPEED, SIGMA, height=90.0, diameter=1.0, period=600.0, seed=5, average="point")[1]
    rotor = turbulence(SPEED, SIGMA, height=90.0, diameter=1e-4, period=600.0, seed=5)[1]
    np.testing.assert_allclose(rotor[:, :3], point[:, :3], atol=1e-3 * SIGMA)
    # per diameter 2 sqrt(1.03 k R) sigma_1 with k R < 1.7e-4 up to 5 Hz
    assert 0.0 < rotor[:, 3:].std() < 0.027 * SIGMA


def test_bigger_rotors_feel_less():
    felt = [amplitudes(SPEED, SIGMA, 90.0, d, 6000, 0.1, "rotor") for d in (50.0, 100.0, 150.0, 250.0)]
    assert np.all(np.diff([np.square(a[:3]).sum(axis=1) for a in felt], axis=0) < 0.0)


def test_same_seed_same_bits_and_other_seeds_differ():
    one = turbulence(SPEED, SIGMA, **NREL5MW, period=650.0, seed=1)[1]
    again = turbulence(SPEED, SIGMA, **NREL5MW, period=650.0, seed=1)[1]
    other = turbulence(SPEED, SIGMA, **NREL5MW, period=650.0, seed=2)[1]
    assert np.array_equal(one, again)
    assert abs(np.corrcoef(one[:, 0], other[:, 0])[0, 1]) < 0.5
    sequence = np.random.SeedSequence(9).spawn(3)[2]  # which a draw does not use up
    seeds = (sequence, sequence, 9)
    drawn = [turbulence(SPEED, SIGMA, **NREL5MW, period=650.0, seed=seed)[1] for seed in seeds]
    assert np.array_equal(drawn[0], drawn[1]) and not np.array_equal(drawn[0], drawn[2])


def test_leaving_out_the_gradients_leaves_the_rest_alone():
    full = turbulence(SPEED, SIGMA, **NREL5MW, period=650.0, seed=4)[1]
    without = turbulence(SPEED, SIGMA, **NREL5MW, period=650.0, seed=4, shear_turbulence=False)[1]
    assert np.array_equal(full[:, :3], without[:, :3])
    assert np.all(without[:, 3:] == 0.0) and full[:, 3:].std() > 1.0


def test_components_are_independent_of_each_other():
    kept = [turbulence(SPEED, SIGMA, **NREL5MW, period=3600.0, seed=s, step=0.5)[1][:-1] for s in range(6)]
    # 0.08: six hours of wind, whose slowest energy has about 200 independent cycles an hour
    assert np.abs(np.corrcoef(np.concatenate(kept).T) - np.eye(5)).max() < 0.08


def test_lengths_transform_quickly_and_never_fall_short():
    for minimum in (1, 2, 7, 6001, 7001, 36011):
        length = fft_length(minimum)
        assert minimum <= length <= 1.1 * minimum + 2 and length % 2 == 0
    assert fft_length(7200) == 7200


def test_the_wind_at_the_hub_has_the_whole_spectrum_and_goes_with_the_disc_average():
    """Coherence of centre and disc average by brute force over points of the disc."""
    radius = 0.5 * NREL5MW["diameter"]
    rho = radius * np.sqrt((np.arange(4000) + 0.5) / 4000.0)
    period, average = turbulence(SPEED, SIGMA, **NREL5MW, period=3600.0, seed=8)
    same, hub = hub_turbulence(SPEED, SIGMA, **NREL5MW, period=3600.0, seed=8)
    assert same == period and np.array_equal(hub[0], hub[-1])
    found = [hub_turbulence(SPEED, SIGMA, **NREL5MW, period=3600.0, seed=seed)[1] for seed in range(8)]
    # expected exactly; single seeds differ as common and own part do by chance
    deviation = np.mean([series[:-1].std(axis=0) for series in found], axis=0)
    np.testing.assert_allclose(deviation, SIGMA * np.array([1.0, 0.8, 0.5]), rtol=0.01)
    spectrum = [np.fft.rfft(series[:-1, 0]) for series in (average, hub)]
    frequency = np.arange(len(spectrum[0])) / period
    for low, high in ((0.002, 0.01), (0.02, 0.04), (0.1, 0.2), (0.5, 1.0)):
        band = (frequency >= low) & (frequency < high)
        k = coherence_wave_number(frequency[band], SPEED, NREL5MW["height"])
        centre = np.exp(-np.outer(k, rho)).mean(axis=1)
        point = amplitudes(SPEED, SIGMA, *NREL5MW.values(), 36000, 0.1, "point")[0][band]
        expected = np.sum(point**2 * centre)  # of point and average, over the band
        cross = np.sum(spectrum[0][band] * spectrum[1][band].conj()) / (0.5 * 36000) ** 2
        rest = np.sqrt(np.sum(point**2) * np.sum(np.abs(spectrum[0][band]) ** 2) / (0.5 * 36000) ** 2)
        assert abs(cross - expected) < 3.0 * rest / np.sqrt(band.sum())


@pytest.mark.parametrize("kr", [1e-6, 9e-4, 1.1e-3, 0.3, 4.0, 300.0])
def test_the_mean_coherence_of_a_disc_s_centre_is_that_of_its_points(kr):
    rho, weight = np.polynomial.legendre.leggauss(400)
    rho, weight = 0.5 * (rho + 1.0), 0.5 * weight
    expected = np.sum(2.0 * rho * np.exp(-kr * rho) * weight)
    assert centre_average(kr) == pytest.approx(expected, rel=1e-7)
