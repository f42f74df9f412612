"""Vector sums against their Python twins, bit for bit, and against numpy."""

import numpy as np
import pytest

from fowt_env.plant.compile.vector_sums import CROSSED, SUM_LANES, _sums_twin, crossed_sums, lane_dot

pytestmark = pytest.mark.installation


@pytest.mark.parametrize("n", [0, 8, 16, 120, 1024])
def test_crossed_sums_have_the_bits_of_the_fixed_order(n):
    rows = np.random.default_rng(n).normal(size=(4, n + 3))
    found = crossed_sums(*rows, n)
    assert found == _sums_twin(rows, CROSSED, n)
    v, g, c, s = rows[:, :n]
    np.testing.assert_allclose(found, [v @ c, v @ s, g @ c, g @ s], rtol=1e-12, atol=1e-12)


def test_a_dot_product_has_the_bits_of_the_fixed_order_at_any_alignment():
    a, b = np.random.default_rng(1).normal(size=(2, 80))
    for start in range(SUM_LANES):
        x, y = a[start : start + 72], b[start : start + 72]
        assert lane_dot(x, y, 72) == _sums_twin((x, y), ((0, 1),), 72)[0]
        assert lane_dot(x, y, 72) == pytest.approx(x @ y, rel=1e-12)


def test_the_order_matters_in_the_last_bits_and_is_the_stated_one():
    a = np.array([1.0, 1e-16, 1.0, 1e-16, 1.0, 1e-16, 1.0, 1e-16] * 4)
    ones = np.ones_like(a)
    lanes = a.reshape(-1, SUM_LANES).sum(axis=0)
    four = lanes[:4] + lanes[4:]
    assert lane_dot(a, ones, a.size) == (four[0] + four[2]) + (four[1] + four[3])
