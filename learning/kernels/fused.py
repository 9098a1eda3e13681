"""Two operations that numba lacks, written for LLVM: what they round, and when, is fixed.

Numba copies a compiled function into each of its callers, and LLVM may optimise every copy anew.
Under numba's ``fastmath`` copies then differ in their last bits, and which one runs depends on what
was compiled and what came from the cache: a first training would not repeat. So the kernels do
without, and say themselves where a product and a sum round once and in which order sums are taken.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

TILE = 4
_VECTOR = ir.VectorType(ir.FloatType(), 16)  # LLVM cuts it up where vectors are shorter


def _fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """``a * b + c`` in float32, rounded once."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float32(types.float32, types.float32, types.float32), generate


def _dots(typing_context: Any, left: Any, right: Any, length: Any) -> Any:
    """The products of TILE rows with TILE others, a tuple of TILE * TILE float32, row by row.

    Args:
        left: (TILE * length,) float32, contiguous.
        right: likewise.
        length: of a row, a multiple of 16. Each of 16 partial sums takes every 16th product in
            turn; then halves are added to halves.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        *arrays, count = arguments
        starts = [
            context.make_array(kind)(context, builder, array).data
            for kind, array in zip(signature.args[:2], arrays, strict=True)
        ]
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        fused = cgutils.get_or_insert_function(builder.module, kind, "llvm.fma.v16f32")
        sums = [
            cgutils.alloca_once_value(builder, ir.Constant(_VECTOR, [0.0] * _VECTOR.count))
            for _ in range(TILE * TILE)
        ]

        def number(value: int) -> Any:
            return context.get_constant(types.intp, value)

        def load(start: Any, row: int, at: Any) -> Any:
            place = builder.gep(start, [builder.add(at, builder.mul(count, number(row)))])
            return builder.load(builder.bitcast(place, _VECTOR.as_pointer()), align=4)

        with cgutils.for_range_slice(
            builder, number(0), count, number(_VECTOR.count), count.type
        ) as (at, _):
            lefts, rights = ([load(start, row, at) for row in range(TILE)] for start in starts)
            pairs = [(one, other) for one in lefts for other in rights]
            for (one, other), total in zip(pairs, sums, strict=True):
                builder.store(builder.call(fused, [one, other, builder.load(total)]), total)
        totals = [add_up(builder, builder.load(total)) for total in sums]
        return context.make_tuple(builder, signature.return_type, totals)

    result = types.UniTuple(types.float32, TILE * TILE)
    return result(left, right, types.intp), generate


def add_up(builder: Any, vector: Any) -> Any:
    """Of a vector's elements: the second half is added to the first until one is left."""
    while vector.type.count > 1:
        half, integer = vector.type.count // 2, ir.IntType(32)
        first, second = (
            ir.Constant(ir.VectorType(integer, half), list(range(start, start + half)))
            for start in (0, half)
        )
        nothing = ir.Constant(vector.type, ir.Undefined)
        vector = builder.fadd(
            builder.shuffle_vector(vector, nothing, first),
            builder.shuffle_vector(vector, nothing, second),
        )
    return builder.extract_element(vector, ir.Constant(ir.IntType(32), 0))


# Called without the typing context.
fma: Any = intrinsic(_fma)
dots: Any = intrinsic(_dots)
