"""Selects one of several kernels by the class of a model part, when the caller is compiled.

Numba prunes a branch on `part is None` only if the part is an argument of the function, not a field. A kernel
therefore takes an optional part as an argument and tests it for None first. A part with several variants has
a class for each, and chosen_by_class compiles only the kernel of the class in use.
"""

import inspect

import numba
from numba import types
from numba.core.extending import overload


def chosen_by_class(argument, cases, inlined=False):
    """Return a function that calls one of cases {class: kernel}, by the class of the named argument.

    All kernels take arguments of the same names. inlined: inline into the caller whatever the size.
    """
    plain = {kind: getattr(kernel, "py_func", kernel) for kind, kernel in cases.items()}
    names = list(inspect.signature(next(iter(plain.values()))).parameters)
    position = names.index(argument)

    def called(*arguments):
        return cases[type(arguments[position])](*arguments)

    if numba.config.DISABLE_JIT:
        return called
    text = ", ".join(names)
    scope = {"called": called, "chosen": lambda kind: plain.get(_class_of(kind))}
    exec(f"def function({text}): return called({text})\ndef choose({text}): return chosen({argument})", scope)
    options = {"error_model": "numpy", "nogil": True, "_nrt": False, "forceinline": inlined}
    overload(scope["function"], jit_options=options)(scope["choose"])
    return scope["function"]


def _class_of(kind):
    """Return the Python class of a numba type, or of the target of a Reference."""
    if isinstance(kind, types.NoneType):
        return type(None)
    return getattr(getattr(kind, "target", kind), "instance_class", None)
