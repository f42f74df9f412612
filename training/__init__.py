"""Contains the applications of the simulator: evaluation, reports, learning, design, the command line."""

if __name__ != "fowt_env.training":  # a module imported under two names would exist twice
    raise ImportError("this package is fowt_env.training: import it by that name")
