"""Just-in-time compilation of forms: the settings that dolfinx's defaults get wrong for us.

Several processes (test workers, runs started together) wait for one another's compiler through the cache; ten seconds
are not enough for that on a busy machine. Importing this module raises the limit.
"""

from dolfinx import jit

TIMEOUT = 90    # s

jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (TIMEOUT, jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"][1])

# Sums may be reordered and reciprocals shared, which makes the tangent a sixth faster (measured); infinities and NaN keep
# their meaning, since a failed solve is told by them. No -march: minutes of compiling, and no gain.
OPTIONS = ["-O2", "-ffast-math", "-fno-finite-math-only"]

jit.DOLFINX_DEFAULT_JIT_OPTIONS["cffi_extra_compile_args"] = (
    OPTIONS, jit.DOLFINX_DEFAULT_JIT_OPTIONS["cffi_extra_compile_args"][1])
