"""Dense kernels of BLAS and LAPACK for compiled code: those that scipy stands on, called by their addresses.

numba keeps the machine code of a function on disk only if no address is written into it; so the addresses are an argument.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import get_cython_function_address, intrinsic

from ..machine_code import compiled

ROUTINES = (("blas", "dgemm"), ("blas", "dsyrk"), ("blas", "dtrsm"), ("lapack", "dpotrf"))
GEMM, SYRK, TRSM, POTRF = range(len(ROUTINES))


class Words(NamedTuple):
    """What the routines are called with beside matrices. Compiled code gives an array back when it last reads it, while its
    address may still be in use: so these belong to the caller.

    routines : addresses, in the order of the names above · letters : L, N, T, R · signs : 1, -1 · counts (4,) : to be set
    """

    routines: np.ndarray
    letters: np.ndarray
    signs: np.ndarray
    counts: np.ndarray


def words() -> Words:
    """Words for one thread."""
    routines = [get_cython_function_address(f"scipy.linalg.cython_{library}", name) for library, name in ROUTINES]
    return Words(np.array(routines, np.int64), np.frombuffer(b"LNTR", np.uint8).copy(), np.array([1.0, -1.0]),
                 np.empty(4, np.int32))


@compiled
def address(array):
    """Where an array begins."""
    return np.int64(array.ctypes.data)


@intrinsic
def call(typing_context, routine, arguments):
    """Call the routine at an address with the addresses of its arguments, a tuple of integers."""
    count = len(arguments)

    def generate(context, builder, signature, given):
        byte = ir.IntType(8).as_pointer()
        function = ir.FunctionType(ir.VoidType(), [byte] * count).as_pointer()
        values = [builder.inttoptr(builder.extract_value(given[1], k), byte) for k in range(count)]
        builder.call(builder.inttoptr(given[0], function), values)
        return context.get_dummy_value()

    return types.void(types.int64, types.UniTuple(types.int64, count)), generate
