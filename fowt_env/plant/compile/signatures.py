"""Remembers the signatures of numba's built-in functions, from one kernel to the next.

For each `+` or `a[i]` numba's type inference tries up to ten templates (numbers, arrays, texts, dates), and
formats an error for each that does not match: a sixth of the compile time of a scene, in which the same few
hundred signatures come ten thousand times.
"""

from contextlib import contextmanager

from numba.core.types import Function

MOST = 20_000  # signatures
_resolve = Function.get_call_type
_known: dict[tuple, object] = {}  # {(function, types of the arguments): signature}
_depth = 0


def _remembered(function, context, args, kws):
    """Return the signature of a built-in function for types of arguments, as Function.get_call_type does.

    Functions that are compiled like user code (numba's overloads) are resolved each time: their code depends
    on the options of the caller.
    """
    signature = None if kws else _known.get((function, args))
    if signature is None:
        signature = _resolve(function, context, args, kws)
        if not kws and function.get_impl_key(signature) is function.key[0] and len(_known) < MOST:
            _known[function, args] = signature
    else:
        function._impl_keys[signature.args] = function.key[0]  # what _resolve leaves for the lowering
    return signature


@contextmanager
def remembered_signatures():
    """Use remembered signatures in a block, which must hold numba's compiler lock."""
    global _depth
    _depth += 1
    Function.get_call_type = _remembered
    try:
        yield
    finally:
        _depth -= 1
        if _depth == 0:
            Function.get_call_type = _resolve
