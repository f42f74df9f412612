"""Makes runs of a design load table from series of formulas, without simulating."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.loads.records import FinishedRun, LoadCase
from fowt_env.training.loads.statistics import run_statistics

SCENE = SimpleNamespace(
    turbine=read_turbine("nrel5mw"), model=SimpleNamespace(layout=SimpleNamespace(base_height=10.0))
)
COLUMNS = (
    "PtfmSurge_[m]", "PtfmSway_[m]", "PtfmHeave_[m]", "PtfmRoll_[deg]", "PtfmPitch_[deg]", "PtfmYaw_[deg]",
    "NcIMUTAxs_[m/s^2]", "NcIMUTAys_[m/s^2]", "Azimuth_[deg]", "RotSpeed_[rpm]", "BldPitch1_[deg]",
    "TwrBsFxt_[kN]", "TwrBsFyt_[kN]", "TwrBsFzt_[kN]", "TwrBsMxt_[kN-m]", "TwrBsMyt_[kN-m]",
    "TwrBsMzt_[kN-m]", "RootMxc1_[kN-m]", "RootMyc1_[kN-m]", "Wave1Elev_[m]", "Wind1VelX_[m/s]",
    "FAIRTEN1_[kN]", "FAIRTEN2_[kN]",
)  # fmt: skip
HOURS = 0.1  # length of the runs that are made here


def frame_of(seed, length=3600.0 * HOURS, scale=1.0, **columns):
    """Return a DataFrame of COLUMNS every 0.1 s: smooth noise of deviation `scale` about a level."""
    random = np.random.default_rng([17, seed])
    time = 0.1 * np.arange(round(length / 0.1) + 1)
    data = {"Time_[s]": time}
    for number, name in enumerate(COLUMNS):
        noise = np.convolve(random.normal(size=len(time) + 30), np.hanning(31), "valid")
        data[name] = scale * noise / noise.std() + (20.0 if "TEN" in name else 3.0 + number)
    return pd.DataFrame(data | columns)


def load_case(dlc="1.3", name="dlc1.3_u12", controller="pi", seed=1, **changes):
    """Return a LoadCase of oc3_hywind, with further fields."""
    fields = {
        "description": "test", "case": Case(name), "duration": 3600.0 * HOURS, "skip": 0.0,
        "analysis": "ultimate", "safety": "normal", "factor": 1.35, "factor_source": "test",
        "characteristic": "mean", "wind_speed": 12.0, "Hs": 3.0, "Tp": 9.0,
    } | changes  # fmt: skip
    return LoadCase(dlc=dlc, name=name, controller=controller, seed=seed, **fields)


def run_of(case, scale=1.0, **columns):
    """Return (LoadCase, RunStatistics) of frame_of(seed of the case)."""
    return case, run_statistics(frame_of(case.seed, scale=scale, **columns), SCENE, 0.0)


def small_table():
    """Return (LoadCases, {key: FinishedRun}): two controllers, production, extreme turbulence, parked."""
    cases = []
    for seed in (1, 2, 3, 4):
        for label in ("pi", "lqr"):
            shared = {"controller": label, "seed": seed}
            for wind in (8.0, 12.0, 16.0):
                at = shared | {"name": f"dlc1.2_u{wind:g}", "wind_speed": wind, "hours_per_year": 500.0}
                cases.append(load_case("1.1", characteristic="extrapolated", factor=1.25, **at))
                cases.append(load_case("1.2", analysis="fatigue", safety="fatigue", factor=1.0, **at))
            cases.append(load_case(**shared))
        cases.append(
            load_case("6.1", "dlc6.1_u50", "parked", seed, wind_speed=50.0, case=Case("x", parked=True))
        )
    finished = {}
    for case in cases:
        if case.key not in finished:
            scale = (0.8 if case.controller == "lqr" else 1.0) * (1.0 + 0.05 * min(case.wind_speed, 16.0))
            scale *= 0.5 if case.case.parked else 1.0
            status = "tripped" if case.key == ("pi", "dlc1.3_u12", 2) else "ok"
            finished[case.key] = FinishedRun(*case.key, status, statistics=run_of(case, scale)[1])
    return cases, finished
