"""What uses the simulator and its controllers: evaluation, reports, learning, design, the command line."""

if __name__ != "fowt_env.training":  # a module that is imported under two names exists twice
    raise ImportError("this package is fowt_env.training: import it by that name")
