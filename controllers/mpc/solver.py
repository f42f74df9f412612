"""Solves the quadratic programs of MPC by OSQP (Stellato et al., Math. Prog. Comp. 12, 2020)."""

import numpy as np
from scipy import sparse

from fowt_env.errors import InputError

SOFT = 100.0  # cost of (a limit's violation in its unit)^2
SOLVED = 1  # OSQP's status
SETTINGS = {
    "verbose": False,
    "eps_abs": 1e-5,
    "eps_rel": 1e-5,
    "max_iter": 1000,
    "check_termination": 10,
    "adaptive_rho": False,  # a changed rho would make a solution depend on earlier runs
    "rho": 10.0,
    "scaling": 0,  # the program is scaled here
    "polishing": False,
}


def load():
    """Return the module osqp. Raises: InputError naming the extra to install if osqp is missing."""
    try:
        import osqp
    except ImportError as error:
        raise InputError(
            f"controller 'mpc': OSQP cannot be imported ({error}); pip install \"fowt-env[mpc]\""
        ) from error
    return osqp


class Program:
    """Minimises z'Hz/2 + g'z + SOFT |v|^2 with low <= C z - v <= high, for one size and any start.

    All limits are soft, so that a solution always exists; applied commands are limited afterwards.
    """

    def __init__(self, moves, rows):
        self.moves, self.rows = moves, rows
        self.soft, self.minus = np.full(rows, 2.0 * SOFT), -np.ones(rows)
        # the upper triangle by columns equals the lower triangle of a symmetric matrix by rows
        self.lower = np.tril_indices(moves)
        # only the sparsity pattern is used here: values are set by each program
        full = np.triu(np.ones((moves, moves))) + moves * np.eye(moves)
        p = sparse.block_diag([full, sparse.diags(self.soft)], format="csc")
        a = sparse.hstack([np.ones((rows, moves)), sparse.diags(self.minus)], format="csc")
        self.gradient = np.zeros(moves + rows)
        wide = np.full(rows, np.inf)
        self.solver = load().OSQP()
        self.solver.setup(p, self.gradient, a, -wide, wide, **SETTINGS)

    def solve(self, h, g, c, low, high, start):
        """Return the solution (moves,), or None if the solver fails; start: initial guess."""
        size = 1.0 / np.sqrt(np.diag(h))
        h, c = h * size[:, None] * size, c * size
        self.gradient[: self.moves] = g * size
        self.solver.update(
            Px=np.concatenate([h[self.lower], self.soft]),
            Ax=np.concatenate([c.ravel(order="F"), self.minus]),
            q=self.gradient,
            l=low,
            u=high,
        )
        first = start / size
        slack = c @ first
        slack -= np.clip(slack, low, high)
        self.solver.warm_start(x=np.concatenate([first, slack]), y=-2.0 * SOFT * slack)
        result = self.solver.solve(raise_error=False)
        if result.info.status_val != SOLVED:
            return None
        return result.x[: self.moves] * size
