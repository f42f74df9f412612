"""Selects one of several kernels by the class of a model part, when the caller is compiled.

Numba prunes a branch on `part is None` only if the part is an argument of the function, not a field. A kernel
therefore takes an optional part as an argument and tests it for None first. A part with several variants has
a class for each, and chosen_by_class compiles only the kernel of the class in use.
"""

import inspect

import numba
from numba import types
from numba.core.datamodel import models, register_default


class Variants:
    """Calls the kernel of the class of an argument: in Python at each call, in kernels when compiled."""

    def __init__(self, argument, cases):
        first = next(iter(cases.values()))
        self.argument = argument
        self.position = list(inspect.signature(getattr(first, "py_func", first)).parameters).index(argument)
        self.cases = cases
        self._numba_type_ = VariantsType(self)

    def __call__(self, *arguments):
        return self.cases[type(arguments[self.position])](*arguments)

    def kernel_for(self, kinds):
        """Return the numba type of the kernel for the numba types of positional arguments."""
        return numba.typeof(self.cases[_class_of(kinds[self.position])])


class VariantsType(types.Callable, types.Dummy):
    """Represents Variants: a call is typed and lowered as one of the chosen kernel."""

    def __init__(self, variants):
        self.variants = variants
        super().__init__(f"Variants({variants.argument}, {variants.cases})")

    def get_call_type(self, context, args, kws):
        """Return the signature of a call of the chosen kernel."""
        return self.variants.kernel_for(args).get_call_type(context, args, kws)

    def get_call_signatures(self):
        """Return the signatures known before a call: none."""
        return (), True

    def get_impl_key(self, sig):
        """Return the key under which numba has the chosen kernel."""
        return self.variants.kernel_for(sig.args).get_impl_key(sig)


register_default(VariantsType)(models.OpaqueModel)


def chosen_by_class(argument, cases):
    """Return a function that calls one of cases {class: kernel}, by the class of the named argument.

    All kernels take arguments of the same names, passed by position.
    """
    return Variants(argument, cases)


def _class_of(kind):
    """Return the Python class of a numba type, or of the target of a Reference."""
    if isinstance(kind, types.NoneType):
        return type(None)
    return getattr(getattr(kind, "target", kind), "instance_class", None)
