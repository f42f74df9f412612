"""Two controllers, one of them your own, on two load cases with the same seeds: a table of metrics."""

from importlib import import_module

from fowt_env.training.evaluation.evaluate import evaluate, summary

SlowPI = import_module("03_own_controller").SlowPI

table = evaluate(
    {"pi": "pi", "slow_pi": SlowPI()},
    cases="steady_16,ntm_18",
    duration=120.0,
    skip=30.0,
    seeds=(1, 2),
)
columns = ["RotSpeed_std_[rpm]", "GenPwr_std_[kW]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]"]
print(summary(table)[["controller", "case", *columns]].round(3).to_string(index=False))
print(f"{(table['status'] == 'ok').sum()} of {len(table)} runs reached their end")
