"""One kernel out of several, chosen by the class of a part when its caller is compiled.

Numba prunes a branch on `part is None` for a function's own argument alone, not for a field. So absence is
tested first thing in a function that takes the part as an argument, and what has several forms is several
classes: chosen_by_class compiles the kernel of one.
"""

import inspect

import numba
from numba import types
from numba.core.extending import overload


def chosen_by_class(argument, cases, inlined=False):
    """A function that is one of cases {class: kernel}, by the class of its argument of this name.

    The kernels take arguments of the same names. inlined: put into the caller whatever the size.
    """
    plain = {kind: getattr(kernel, "py_func", kernel) for kind, kernel in cases.items()}
    names = list(inspect.signature(next(iter(plain.values()))).parameters)
    place = names.index(argument)

    def called(*arguments):
        return cases[type(arguments[place])](*arguments)

    if numba.config.DISABLE_JIT:
        return called
    text = ", ".join(names)
    scope = {"called": called, "chosen": lambda kind: plain.get(_class_of(kind))}
    exec(f"def function({text}): return called({text})\ndef choose({text}): return chosen({argument})", scope)
    options = {"error_model": "numpy", "nogil": True, "_nrt": False, "forceinline": inlined}
    overload(scope["function"], jit_options=options)(scope["choose"])
    return scope["function"]


def _class_of(kind):
    """Class of the values of a numba type, or of what a Reference refers to."""
    if isinstance(kind, types.NoneType):
        return type(None)
    return getattr(getattr(kind, "target", kind), "instance_class", None)
