"""Defines the Handle that passes a constant model and its changing data from Python to kernels.

Numba passes a NamedTuple by value, some 400 machine words for a model, in every call between kernels; a
reference is one word. Kernels therefore see a NamedTuple class marked by_reference as a Reference, both in
a Handle and as a field of another such class; its other fields are plain values.

A Reference does not keep its target alive: it is made in an entry, whose caller keeps the Handle.
"""

import numba
import numpy as np
from numba import types
from numba.core import cgutils, imputils
from numba.core.datamodel import models, register_default
from numba.core.extending import infer_getattr, intrinsic, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate

from fowt_env.caches import Cache
from fowt_env.plant.compile.payload import payload_writer


def by_reference(kind):
    """Mark a NamedTuple class (decorator): kernels see it as a Reference."""
    kind.by_reference = True
    return kind


if numba.config.DISABLE_JIT:

    class Handle:
        """Holds a model and data, in place of the compiled handle when the JIT is off."""

        def __init__(self, model, data):
            self.model = model
            self.data = data

    def model_of(handle):
        """Return the model of a Handle."""
        return handle.model

    def data_of(handle):
        """Return the data of a Handle."""
        return handle.data

else:
    from numba._dispatcher import compute_fingerprint
    from numba.core.registry import cpu_target
    from numba.core.runtime import rtsys
    from numba.experimental import structref

    class Reference(types.Type):
        """Represents the address of a NamedTuple; its attributes are the fields of the tuple."""

        def __init__(self, target):
            self.target = target
            super().__init__(name=f"Reference({target})")

    @register_default(Reference)
    class _ReferenceModel(models.PrimitiveModel):
        def __init__(self, manager, kind):
            super().__init__(manager, kind, manager.lookup(kind.target).get_value_type().as_pointer())

    def _by_reference(kind):
        """Return whether kernels see a numba type as a Reference."""
        return isinstance(kind, types.NamedTuple) and getattr(kind.instance_class, "by_reference", False)

    @infer_getattr
    class _ReferenceAttributes(AttributeTemplate):
        key = Reference

        def generic_resolve(self, kind, name):
            fields = kind.target.fields
            if name in fields:
                field = kind.target.types[fields.index(name)]
                return Reference(field) if _by_reference(field) else field

    @lower_getattr_generic(Reference)
    def _read_field(context, builder, kind, value, name):
        number = kind.target.fields.index(name)
        address = cgutils.gep_inbounds(builder, value, 0, number)
        field = kind.target.types[number]
        if _by_reference(field):
            return address
        return imputils.impl_ret_borrowed(context, builder, field, builder.load(address))

    @structref.register
    class _HandleType(types.StructRef):
        def preprocess_fields(self, fields):
            return tuple((name, types.unliteral(kind)) for name, kind in fields)

    class Handle(structref.StructRefProxy):
        """Holds a model and data in the form that entries take from Python.

        Passing a structref from Python, and into prange, is far cheaper than passing nested NamedTuples.
        """

        def __new__(cls, model, data):
            values = model, data
            kind, size, write = _payload(values)
            payload = np.zeros(size, dtype=np.uint8)
            write(memoryview(payload), 0, values)  # much faster than to the array itself
            owner = payload, values  # all memory that the payload refers to
            return cls._numba_box_(kind, rtsys.meminfo_new(payload.ctypes.data, owner))

    structref.define_boxing(_HandleType, Handle)
    _payloads = Cache(64)  # by numba's fingerprint of a type: determining the type takes a ms

    def _payload(values):
        """Return (type of the Handle, size of its payload in bytes, writer) of (model, data)."""

        def payload():
            rtsys.initialize(cpu_target.target_context)  # as numba does before it compiles
            kinds, size, write = payload_writer(values)
            return _HandleType(list(zip(("model", "data"), kinds, strict=True))), size, write

        try:
            return _payloads.get(compute_fingerprint(values), payload)
        except NotImplementedError:  # it has none for a compiled function
            return payload()

    def _reference_to(name):
        """Return the intrinsic that takes a Handle and returns a Reference to its field of this name."""

        @intrinsic
        def reference(typing_context, handle):
            field = handle.field_dict[name]

            def build(context, builder, signature, arguments):
                utils = structref._Utils(context, builder, handle)
                return utils.get_data_struct(arguments[0])._get_ptr_by_name(name)

            return Reference(field)(handle), build

        return reference

    model_of, data_of = _reference_to("model"), _reference_to("data")
