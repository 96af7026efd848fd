"""What compiled tests of lanes take: arrays whose last axis is the walk's as arrays of lanes."""

from numba import config, types
from numba.extending import intrinsic

from vsf_drake.laws.lanes import LANE, as_lanes


@intrinsic
def _lanes(typingctx, array):
    made = types.Array(LANE, array.ndim - 1, "C", aligned=False)
    return made(array), lambda context, builder, signature, values: as_lanes(
        context, builder, array, made, values[0]
    )


lanes = (lambda array: array) if config.DISABLE_JIT else _lanes
