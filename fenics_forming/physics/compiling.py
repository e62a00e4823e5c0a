"""Just-in-time compilation of forms: the one setting that dolfinx's defaults get wrong for us.

Several processes (test workers, runs started together) wait for one another's compiler through the cache; ten seconds
are not enough for that on a busy machine. Importing this module raises the limit.
"""

from dolfinx import jit

TIMEOUT = 90    # s

jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (TIMEOUT, jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"][1])
