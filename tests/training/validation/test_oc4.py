"""Members and dynamic inflow against OpenFAST: decays and a sea of the OC4 semi-submersible, DBEMT."""

from dataclasses import replace

import numpy as np
import pytest

from fowt_env.training.validation import oc4, volturnus
from fowt_env.training.validation.comparison import Study
from fowt_env.training.validation.openfast_cases import table
from fowt_env.training.validation.signal_errors import normalised_rms
from fowt_env.training.validation.validate import validate_cases

TIME = "Time_[s]"


def judged(study, targets):
    """{quantity: row} of a study; errors are worked out anew, and held to the first of {part: percent}."""
    for row in study.rows:
        wanted = next(percent for part, percent in targets.items() if part in row.quantity)
        assert np.array_equal(row.allowed, np.nan if wanted is None else wanted, equal_nan=True), row
        if "rms" not in row.quantity:
            error = 100.0 * (row.here - row.openfast) / row.openfast
            assert row.error == pytest.approx(error, rel=1e-9, abs=1e-9), row
        assert wanted is None or abs(row.error) <= wanted, f"{row.case}: {row.quantity}: {row.error:.3g} %"
    return {f"{row.case}: {row.quantity}": row for row in study.rows}


def test_heave_of_a_hull_with_heave_plates_decays_as_with_openfasts_members():
    """Most of the damping is that of the plates; without members' drag the decay is far off."""
    run = oc4.RUNS["decay_heave"]
    theirs, ours = run.theirs(), run.frame()
    heave = "PtfmHeave_[m]"
    assert np.allclose(ours[TIME], theirs[TIME])
    assert normalised_rms(ours[heave], theirs[heave]) < 0.01


@pytest.mark.slow
@pytest.mark.nightly
def test_decays_with_members_are_openfasts():
    study = Study(platform=oc4.PLATFORM, cases=oc4.RUNS)
    oc4.decays(study)
    rows = judged(study, {"published": None, "period": 0.2, "decrement": 2.0, "rms error": 1.0})
    assert len(rows) == 10
    # 0.8 %: what the turning of the water in the columns is worth, and the only thing that differs
    published = rows["decay_pitch: period, first 4 cycles, published inertia"]
    assert published.error == pytest.approx(-0.77, abs=0.05)


@pytest.mark.slow
@pytest.mark.nightly
def test_the_first_waves_move_a_hull_with_members_as_in_openfast():
    """Within 3 % of the deviation, where the whole record below is within 1.6 %."""
    run = replace(oc4.RUNS["waves_Hs7.5"], duration=100.0)
    ours = run.frame()
    theirs = run.theirs().iloc[: len(ours)]
    assert np.allclose(ours[TIME], theirs[TIME])
    for channel, least in (("PtfmSurge_[m]", 1.0), ("PtfmHeave_[m]", 0.1), ("PtfmPitch_[deg]", 0.1)):
        assert theirs[channel].std() > least
        assert normalised_rms(ours[channel], theirs[channel]) < 0.03


@pytest.mark.slow
@pytest.mark.nightly
def test_motions_of_a_hull_with_members_in_a_sea_are_openfasts():
    study = validate_cases(["waves"], platform=oc4.PLATFORM)
    for case, allowed in (("waves_Hs7.5", 2.0), ("waves_Hs7.5_qtf", 5.0), ("waves_Hs7.5_moordyn", None)):
        part = Study(rows=[row for row in study.rows if row.case == case])
        assert len(judged(part, {"standard deviation": allowed, "mean": None, "rms error": None})) == 9


@pytest.mark.slow
def test_the_wake_answers_steps_of_wind_and_blade_pitch_as_aerodyns_dbemt_does():
    study = Study(platform=volturnus.PLATFORM, cases=volturnus.RUNS)
    volturnus.wake(study)
    targets = {"before": 0.5, "long after": 0.5, "time of": 10.0, ", overshoot": 5.0, "rms": None}
    assert sum(volturnus.WAKES.values()) == 3
    for case, counts in volturnus.WAKES.items():
        part = Study(rows=[row for row in study.rows if row.case == case])
        rows = judged(part, targets if counts else dict.fromkeys(targets))
        assert len(rows) == 2 * 5
        for channel in ("RtFldFxh", "RtFldMxh"):  # an instantaneous wake has no overshoot
            change = rows[f"{case}: {channel}, long after it"].openfast
            change -= rows[f"{case}: {channel}, before the step"].openfast
            assert rows[f"{case}: {channel}, overshoot"].openfast / change > 0.05


def test_steps_of_the_wake_settle_within_the_record():
    for case in volturnus.WAKES:
        run = table(f"{volturnus.PLATFORM}/{case}.csv.gz")
        last = run["aero_thrust_N"][run["time_s"] >= 100.0]
        assert last.std() < 1e-3 * last.mean()
