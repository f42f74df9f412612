"""Limits linear algebra of small matrices to one thread.

BLAS spreads products of matrices of some tens of rows over all cores. Its threads wait for each other: beside
other processes a design of mpc took four times as long as on one thread (17 and 4.3 s on two busy cores).
"""

from functools import cache, wraps

from threadpoolctl import ThreadpoolController


@cache
def _libraries():
    """Return the ThreadpoolController of the loaded libraries, of which NumPy and SciPy have one each."""
    import scipy.linalg  # noqa: F401  # loads that of SciPy

    return ThreadpoolController()


def one_thread(function):
    """Return the function with BLAS on one thread during its calls (decorator)."""

    @wraps(function)
    def limited(*arguments, **keywords):
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*arguments, **keywords)

    return limited
