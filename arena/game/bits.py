"""What LLVM has and Python lacks: counting and finding bits, and laying 64 bits of fog over 64 cells."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_CELLS = 64


@intrinsic
def popcount(typing_context: Any, word: Any) -> Any:
    """Return how many bits of a uint64 are set, as int64."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.ctpop(args[0])

    return types.int64(types.uint64), generate


@intrinsic
def lowest_bit(typing_context: Any, word: Any) -> Any:
    """Return the place of the lowest set bit of a uint64, as int64; of zero, 64."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 0))

    return types.int64(types.uint64), generate


@intrinsic
def cover(typing_context: Any, out: Any, source: Any, row: Any, first: Any, visible: Any) -> Any:
    """Copy 64 cells of a board, each -1 unless its bit is set.

    Parameters
    ----------
    out, source
        int8 arrays, C-contiguous, shape (rows, stride), stride a multiple of 64.
    row, first
        int64: the row, and the first of the 64 cells in it.
    visible
        uint64: bit k is set if cell first + k may be seen.

    Notes
    -----
    A mask of 64 bits widens to 64 bytes in one instruction where the machine has one (AVX-512), in few elsewhere.
    """
    vector = ir.VectorType(ir.IntType(8), _CELLS)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        def block(array_type: Any, array: Any) -> Any:
            struct = context.make_array(array_type)(context, builder, array)
            shape, strides = (cgutils.unpack_tuple(builder, sizes) for sizes in (struct.shape, struct.strides))
            place = cgutils.get_item_pointer2(
                context, builder, struct.data, shape, strides, array_type.layout, [args[2], args[3]]
            )
            return builder.bitcast(place, vector.as_pointer())

        hidden = builder.bitcast(builder.not_(args[4]), ir.VectorType(ir.IntType(1), _CELLS))
        cells = builder.load(block(signature.args[1], args[1]), align=1)
        builder.store(builder.or_(cells, builder.sext(hidden, vector)), block(signature.args[0], args[0]), align=1)
        return context.get_dummy_value()

    return types.void(out, source, types.int64, types.int64, types.uint64), generate
