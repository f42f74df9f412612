"""What Python holds and hands to kernels: a model, which never changes, and data, which does.

A NamedTuple goes by value, some 400 machine words for a model, in every call from one kernel to the next; a
reference is one word. So a class of NamedTuples that is marked by_reference is seen by kernels as a
Reference, in a Handle and as a field of another such class; its parts are plain values.

A Reference does not keep what it refers to alive. It is made in an entry, whose caller holds the Handle.
"""

import numba
from numba import types
from numba.core import cgutils, imputils
from numba.core.datamodel import models, register_default
from numba.core.extending import infer_getattr, intrinsic, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate

from fowt_env.plant.compile.decorators import entry


def by_reference(kind):
    """Class decorator: kernels see this NamedTuple as a Reference."""
    kind.by_reference = True
    return kind


if numba.config.DISABLE_JIT:

    class Handle:
        """Plain twin of the compiled handle, for runs with the JIT off."""

        def __init__(self, model, data):
            self.model = model
            self.data = data

    def model_of(handle):
        """The model of a handle."""
        return handle.model

    def data_of(handle):
        """The data of a handle."""
        return handle.data

else:
    from numba.experimental import structref

    class Reference(types.Type):
        """Address of a NamedTuple, with the attributes of its fields."""

        def __init__(self, target):
            self.target = target
            super().__init__(name=f"Reference({target})")

    @register_default(Reference)
    class _ReferenceModel(models.PrimitiveModel):
        def __init__(self, manager, kind):
            super().__init__(manager, kind, manager.lookup(kind.target).get_value_type().as_pointer())

    def _by_reference(kind):
        """Whether kernels see a type as a Reference."""
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
        place = cgutils.gep_inbounds(builder, value, 0, number)
        field = kind.target.types[number]
        if _by_reference(field):
            return place
        return imputils.impl_ret_borrowed(context, builder, field, builder.load(place))

    @structref.register
    class _HandleType(types.StructRef):
        def preprocess_fields(self, fields):
            return tuple((name, types.unliteral(kind)) for name, kind in fields)

    class Handle(structref.StructRefProxy):
        """A model and data in the form that entries take from Python.

        A structref crosses from Python, and into prange, far cheaper than nested NamedTuples.
        """

        def __new__(cls, model, data):
            return _filled_handle(model, data)

    structref.define_proxy(Handle, _HandleType, ["model", "data"])

    @entry
    def _filled_handle(model, data):
        """A Handle; numba's own constructor would be compiled anew, for a second, in every process."""
        return Handle(model, data)

    def _place_of(name):
        """Intrinsic: Reference to a field of a Handle."""

        @intrinsic
        def place(typing_context, handle):
            field = handle.field_dict[name]

            def build(context, builder, signature, arguments):
                utils = structref._Utils(context, builder, handle)
                return utils.get_data_struct(arguments[0])._get_ptr_by_name(name)

            return Reference(field)(handle), build

        return place

    model_of, data_of = _place_of("model"), _place_of("data")
