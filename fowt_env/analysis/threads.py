"""Limits linear algebra of small matrices to one thread.

BLAS spreads products of matrices of some tens of rows over all cores. Its threads wait for each other: beside
other processes a design of mpc took four times as long as on one thread (17 and 4.3 s on two busy cores).
"""

from functools import wraps

from threadpoolctl import ThreadpoolController

from fowt_env.caches import Cache

_controllers = Cache(1)  # to look for the libraries takes milliseconds


def _libraries():
    """Return the ThreadpoolController of the loaded libraries, of which NumPy and SciPy have one each."""
    import scipy.linalg  # noqa: F401  # loads that of SciPy

    return _controllers.get("blas", ThreadpoolController)


def one_thread(function):
    """Return the function with BLAS on one thread during its calls (decorator)."""

    @wraps(function)
    def limited(*arguments, **keywords):
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*arguments, **keywords)

    return limited
