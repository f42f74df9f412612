"""Reading of WAMIT's files: units, limits of frequency, symmetry, and files that are broken."""

import math

import numpy as np
import pytest

from fowt_env.descriptions.potential_flow import read_potential_flow
from fowt_env.descriptions.wamit import read_wamit
from fowt_env.errors import InputError

WATER = dict(length_scale=2.0, gravity=10.0, density=1000.0)
PERIODS = (-1.0, 0.0, 2.0, 4.0, 8.0, 16.0)


def lines_1():
    """.1 of a body with 11, 15, 33 and 55; the damping of 11 is the period over 10."""
    rows = []
    for period in PERIODS:
        for i, j, a in ((1, 1, 3.0), (1, 5, 0.5), (3, 3, 7.0), (5, 5, 11.0)):
            damping = f"  {0.1 * period * (0.2 if i != j else 1.0):.6E}" if period > 0.0 else ""
            rows.append(f" {period:.6E}     {i}     {j}  {a + 0.01 * period:.6E}{damping}")
    return rows


def lines_3():
    return [
        f" {period:.6E}  {heading:.6E}     {i}  1.0 0.0  {0.1 * i * period:.6E} {heading / 90.0:.6E}"
        for period in (2.0, 4.0, 8.0)
        for heading in (-90.0, 0.0, 90.0)
        for i in (1, 3, 5)
    ]


def lines_hst():
    return [
        f"  {i}  {j}  {5.0 if i == j in (3, 4, 5) else 0.0:.6E}" for i in range(1, 7) for j in range(1, 7)
    ]


def lines_12d():
    """Upper triangle of three periods, but for the corner, in headings (0, 30)."""
    rows = [" WAMIT Numeric Output -- Filename body.12d"]
    periods = (10.0, 5.0, 2.5)
    for a, first in enumerate(periods):
        for b, second in enumerate(periods[a:], a):
            if (a, b) != (0, 2):
                rows += [f"{first} {second} 0.0 30.0 {i} 9.0 9.0 {a + 0.1 * i} {b - a}" for i in (1, 5)]
    return rows


def files(folder, name="body", **replaced):
    content = {".1": lines_1(), ".3": lines_3(), ".hst": lines_hst(), ".12d": lines_12d()}
    content |= {f".{key.removeprefix('end_')}": lines for key, lines in replaced.items()}
    for ending, lines in content.items():
        if lines is not None:
            (folder / f"{name}{ending}").write_text("\n".join(lines) + "\n")
    return folder / "body"


def test_figures_become_dimensional_by_the_water_and_the_length(tmp_path):
    """L = 2 m, rho = 1000: forces per acceleration rho L^3, per turning L^4, moments L^5; stiffness rho g."""
    body = read_wamit(files(tmp_path), **WATER)
    assert body.omega == pytest.approx(2.0 * math.pi / np.array([16.0, 8.0, 4.0, 2.0]))
    assert body.added_mass[-1, 0, 0] == pytest.approx(3.02 * 8e3)
    assert body.added_mass[-1, 0, 4] == body.added_mass[-1, 4, 0] == pytest.approx(0.52 * 16e3)
    assert body.added_mass[-1, 4, 4] == pytest.approx(11.02 * 32e3)
    assert body.damping[:, 2, 2] == pytest.approx(np.full(4, 0.2 * math.pi * 8e3))
    assert body.excitation[-1, :, 2] == pytest.approx((0.6 + 1j * np.array([-1.0, 0.0, 1.0])) * 1e4 * 4.0)
    assert body.excitation[-1, 1, 4] == pytest.approx(1.0 * 1e4 * 8.0)
    assert body.heading == pytest.approx([-0.5 * math.pi, 0.0, 0.5 * math.pi])
    assert np.diag(body.stiffness) == pytest.approx([0.0, 0.0, 5e4 * 4.0, 5e4 * 16.0, 5e4 * 16.0, 0.0])
    assert math.isnan(body.volume)


def test_a_negative_period_is_the_zero_frequency_and_a_zero_period_the_infinite_one(tmp_path):
    body = read_wamit(files(tmp_path), **WATER)
    assert body.added_mass_zero[0, 0] == pytest.approx(2.99 * 8e3)
    assert body.added_mass_infinite[0, 0] == pytest.approx(3.0 * 8e3)
    without = [line for line in lines_1() if not line.startswith(" -")]
    assert read_wamit(files(tmp_path, end_1=without), **WATER).added_mass_zero is None


def test_the_other_side_of_a_qtf_is_conjugate_with_its_headings_exchanged(tmp_path):
    qtf = read_wamit(files(tmp_path), **WATER).difference_qtf
    assert qtf.omega == pytest.approx(2.0 * math.pi / np.array([10.0, 5.0, 2.5]))
    assert np.degrees(qtf.heading) == pytest.approx(np.array([[0.0, 30.0], [30.0, 0.0]]))
    assert qtf.value[0, 0, 1, 0] == pytest.approx((0.1 + 1j) * 1e4 * 2.0)
    assert qtf.value[0, 0, 1, 4] == pytest.approx((0.5 + 1j) * 1e4 * 4.0)
    known = ~np.isnan(qtf.value)
    assert np.array_equal(known[1], known[0].swapaxes(0, 1))
    assert np.nan_to_num(qtf.value[1]) == pytest.approx(np.nan_to_num(qtf.value[0]).conj().swapaxes(0, 1))
    assert np.isnan(qtf.value[:, 0, 2]).all(axis=-1).tolist() == [True, True]
    assert (qtf.value[0, 0, 0, [1, 2, 3, 5]] == 0.0).all()


def test_the_other_side_of_a_qtf_of_sums_is_equal_with_its_headings_exchanged(tmp_path):
    root = files(tmp_path)
    assert read_wamit(root, **WATER).sum_qtf is None
    (tmp_path / "body.12s").write_text((tmp_path / "body.12d").read_text())
    body = read_wamit(root, **WATER)
    of_sums, difference = body.sum_qtf, body.difference_qtf
    assert of_sums.of_sums and not difference.of_sums
    assert of_sums.value[0, 0, 1, 0] == difference.value[0, 0, 1, 0] == pytest.approx((0.1 + 1j) * 1e4 * 2.0)
    assert np.nan_to_num(of_sums.value[1]) == pytest.approx(np.nan_to_num(of_sums.value[0]).swapaxes(0, 1))


def test_names_are_found_whatever_their_case_and_platform_files_take_them(tmp_path):
    files(tmp_path, "BODY")
    assert read_wamit(tmp_path / "body", **WATER).omega.size == 4
    table = {"coefficients": "Body", "displaced_volume": 12.0, "length_scale": 2.0, "draft": 3.0}
    body = read_potential_flow(table, tmp_path, 10.0, 1000.0)
    assert (body.volume, body.draft) == (12.0, 3.0)
    assert body.added_mass_infinite[2, 2] == pytest.approx(7.0 * 8e3)


def test_excitation_from_elsewhere_stands_for_the_file(tmp_path):
    given = (np.array([0.5]), np.array([0.0]), np.ones((1, 1, 6), complex))
    body = read_wamit(files(tmp_path, end_3=None), **WATER, excitation=given)
    assert body.excitation[0, 0, 0] == 1.0 and body.difference_qtf is not None


def changed(lines, number, text):
    lines = list(lines)
    lines[number - 1] = text
    return lines


@pytest.mark.parametrize(
    ("replaced", "words"),
    [
        ({"end_1": None}, r"body\.1.*added mass and damping.*does not exist"),
        ({"end_3": None}, r"body\.3.*does not exist"),
        ({"end_hst": None}, r"body\.hst.*does not exist"),
        (
            {"end_1": [row for row in lines_1() if not row.startswith(" 0.0")]},
            "no rows of infinite frequency",
        ),
        ({"end_1": changed(lines_1(), 9, " 2.0  1  1  x3")}, r"body\.1.*line 9: 'x3' is not a number"),
        ({"end_1": changed(lines_1(), 9, " 2.0  1  1  nan 1.0")}, "line 9: 'nan' is not a finite number"),
        ({"end_1": changed(lines_1(), 9, " 2.0  1  1")}, "line 9 has 3 columns; expected 4 or 5"),
        ({"end_1": changed(lines_1(), 9, " 2.0  1  1  3.0")}, "line 9 has no damping"),
        ({"end_1": changed(lines_1(), 9, " 2.0  1  7  3.0 1.0")}, "line 9: mode 7: must be 1 to 6"),
        (
            {"end_1": changed(lines_1(), 9, " 2.0  3  3  3.0 1.0")},
            "line 11: entry 3 3 of period 2 s is",
        ),
        (
            {"end_1": changed(lines_1(), 9, " 2.0  2  2  3.0 1.0")},
            "line 1: zero frequency.*no entry 2 2, others",
        ),
        ({"end_1": changed(lines_1(), 9, " 2.0  1  1  3.0 -1.0")}, r"damping 1 1 at 3.142 rad/s is negative"),
        ({"end_1": lines_1()[:16]}, "2 finite frequencies; needed: at least 3"),
        ({"end_1": []}, "has no rows of numbers"),
        ({"end_3": lines_3()[:-1]}, "no row of period 8, heading 90, mode 5"),
        ({"end_3": [*lines_3(), lines_3()[0]]}, "line 28: period, heading and mode are listed twice"),
        (
            {"end_3": changed(lines_3(), 2, "2.0 400 1 1 1 1 1")},
            "line 2: heading 400 deg: must be -360 to",
        ),
        ({"end_hst": lines_hst()[:10]}, "no entry 3 3"),
        ({"end_hst": [*lines_hst(), "1 1 2.0"]}, "line 37: entry 1 1 is listed twice"),
        ({"end_12d": [*lines_12d(), "10 5 0 30 1 1 1 1"]}, "has 8 columns; expected 9"),
        ({"end_12d": [*lines_12d(), lines_12d()[1]]}, "periods, headings and mode are listed twice"),
        ({"end_12d": [*lines_12d(), "-1 5 0 30 1 1 1 1 1"]}, "period -1 s: must be"),
    ],
)
def test_what_is_wrong_is_named_with_its_file_line_and_figure(tmp_path, replaced, words):
    with pytest.raises(InputError, match=words):
        read_wamit(files(tmp_path, **replaced), **WATER)


def broken(text, rng):
    """The text with a few characters changed, removed or said twice, or figures exchanged for odd ones."""
    odd = ("nan", "inf", "-1", "0", "1e400", "1e300", "7", "x", "1.0D+01", "-0.0", "1_0", "", "1e-320")
    for _ in range(rng.integers(1, 4)):
        place = int(rng.integers(len(text)))
        kind = rng.integers(4)
        if kind == 0:
            text = text[:place] + chr(int(rng.integers(32, 300))) + text[place + 1 :]
        elif kind == 1:
            text = text[:place] + text[place + int(rng.integers(1, 100)) :]
        elif kind == 2:
            text = text[:place] + text[place : place + int(rng.integers(1, 100))] + text[place:]
        else:
            lines = text.split("\n")
            row = int(rng.integers(len(lines)))
            cells = lines[row].split()
            if cells:
                cells[int(rng.integers(len(cells)))] = str(rng.choice(odd))
            text = "\n".join([*lines[:row], " ".join(cells), *lines[row + 1 :]])
    return text


def test_hundreds_of_broken_files_are_read_or_refused(tmp_path):
    rng, root = np.random.default_rng(1), files(tmp_path)
    sound = {ending: (tmp_path / f"body{ending}").read_text() for ending in (".1", ".3", ".hst", ".12d")}
    refused, read = 0, 0
    for number in range(400):
        ending = tuple(sound)[number % 4]
        path = tmp_path / f"body{ending}"
        path.write_text(broken(sound[ending], rng))
        try:
            body = read_wamit(root, **WATER)
        except InputError as error:
            assert f"body{ending}" in str(error) and len(str(error)) < 1000
            refused += 1
        else:
            assert np.isfinite(body.added_mass).all() and np.isfinite(body.damping).all()
            assert np.isfinite(body.excitation).all() and (np.diff(body.omega) > 0.0).all()
            read += 1
        path.write_text(sound[ending])
    assert min(refused, read) > 10
