"""The two products a convolution and its gradient are made of, written for LLVM.

As in ``steerlab.learning.kernels.fused``: what is rounded when, and in which order sums are taken,
is fixed, so results depend neither on the processor nor on what was compiled before. Values lie
``LANES`` observations side by side; one vector holds the same value of all of them.
"""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from steerlab.learning.kernels.fused import add_up
from steerlab.learning.policy import TILE

LANES = 16
PATCH = 4  # rows and columns that one ``outer_products`` computes
_VECTOR = ir.VectorType(ir.FloatType(), LANES)  # LLVM cuts it up where vectors are shorter


def _add_products(
    typing_context: Any,
    weights: Any,
    weight_start: Any,
    weight_stride: Any,
    values: Any,
    value_start: Any,
    offsets: Any,
    out: Any,
    out_start: Any,
    out_stride: Any,
) -> Any:
    """``out[c] += sum over k of weights[k, c] * values[k]`` for ``TILE`` outputs c, in order of k.

    Args:
        weights: float32, flat; (k, c) is at ``weight_start + k * weight_stride + c``.
        values: float32, flat; vector k begins at ``value_start + offsets[k]``.
        offsets: int64, one a term.
        out: float32, flat; vector c begins at ``out_start + c * out_stride``.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        code = _Code(context, builder, signature, arguments)
        w, v, o = code.data(0), code.data(3), code.data(6)
        places = [
            builder.add(arguments[7], builder.mul(arguments[8], code.number(c)))
            for c in range(TILE)
        ]
        sums = [
            cgutils.alloca_once_value(builder, code.vector(o, place)) for place in places
        ]  # fmt: skip
        shift = code.data(5)
        with cgutils.for_range(builder, code.size(5)) as loop:
            k = loop.index
            value = code.vector(v, builder.add(arguments[4], builder.load(builder.gep(shift, [k]))))
            row = builder.add(arguments[1], builder.mul(arguments[2], k))
            for c, total in enumerate(sums):
                weight = builder.load(builder.gep(w, [builder.add(row, code.number(c))]))
                builder.store(code.fma(code.spread(weight), value, builder.load(total)), total)
        for place, total in zip(places, sums, strict=True):
            code.put(builder.load(total), o, place)
        return context.get_dummy_value()

    integer = types.intp
    return types.void(
        weights, integer, integer, values, integer, offsets, out, integer, integer
    ), generate


def _outer_products(
    typing_context: Any,
    left: Any,
    left_start: Any,
    left_stride: Any,
    left_at: Any,
    right: Any,
    right_starts: Any,
    right_at: Any,
) -> Any:
    """``sum over p and lanes of left[row, p] * right[column, p]``, ``PATCH`` x ``PATCH`` of them.

    Args:
        left: float32, flat; vector (row, p) begins at
            ``left_start + row * left_stride + left_at[p]``.
        right: float32, flat; vector (column, p) begins at ``right_starts[column] + right_at[p]``.
        left_at: int64, one a place p.
        right_at: int64, likewise.

    Returns:
        a tuple of float32, row by row. Each lane is summed in order of p, then halves of the lanes
        are added to halves.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        code = _Code(context, builder, signature, arguments)
        one, other, at, right_place = code.data(0), code.data(4), code.data(3), code.data(6)
        rows = [
            builder.add(arguments[1], builder.mul(arguments[2], code.number(row)))
            for row in range(PATCH)
        ]
        columns = [builder.extract_value(arguments[5], column) for column in range(PATCH)]
        nothing = ir.Constant(_VECTOR, [0.0] * LANES)
        sums = [cgutils.alloca_once_value(builder, nothing) for _ in range(PATCH * PATCH)]
        with cgutils.for_range(builder, code.size(3)) as loop:
            places = [builder.load(builder.gep(table, [loop.index])) for table in (at, right_place)]
            lefts = [code.vector(one, builder.add(row, places[0])) for row in rows]
            rights = [code.vector(other, builder.add(column, places[1])) for column in columns]
            pairs = [(a, b) for a in lefts for b in rights]
            for (a, b), total in zip(pairs, sums, strict=True):
                builder.store(code.fma(a, b, builder.load(total)), total)
        totals = [add_up(builder, builder.load(total)) for total in sums]
        return context.make_tuple(builder, signature.return_type, totals)

    integer = types.intp
    result = types.UniTuple(types.float32, PATCH * PATCH)
    starts = types.UniTuple(types.intp, PATCH)
    return result(left, integer, integer, left_at, right, starts, right_at), generate


class _Code:
    """What both say to LLVM."""

    def __init__(
        self, context: Any, builder: Any, signature: Any, arguments: Sequence[Any]
    ) -> None:
        self._context, self._builder = context, builder
        self._arrays = {
            index: context.make_array(kind)(context, builder, argument)
            for index, (kind, argument) in enumerate(zip(signature.args, arguments, strict=True))
            if isinstance(kind, types.Array)
        }
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        self._fma = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fma.v{LANES}f32")

    def number(self, value: int) -> Any:
        return self._context.get_constant(types.intp, value)

    def data(self, index: int) -> Any:
        return self._arrays[index].data

    def size(self, index: int) -> Any:
        return self._builder.extract_value(self._arrays[index].shape, 0)

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        return self._builder.call(self._fma, [a, b, c])

    def spread(self, value: Any) -> Any:
        """One float32 in every lane."""
        nothing = ir.Constant(_VECTOR, ir.Undefined)
        first = self._builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return self._builder.shuffle_vector(first, nothing, zeros)

    def vector(self, start: Any, at: Any) -> Any:
        return self._builder.load(self._place(start, at), align=4)

    def put(self, value: Any, start: Any, at: Any) -> None:
        self._builder.store(value, self._place(start, at), align=4)

    def _place(self, start: Any, at: Any) -> Any:
        return self._builder.bitcast(self._builder.gep(start, [at]), _VECTOR.as_pointer())


# Called without the typing context.
add_products: Any = intrinsic(_add_products)
outer_products: Any = intrinsic(_outer_products)
