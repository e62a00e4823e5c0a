"""Just-in-time compilation of forms: the settings that dolfinx's defaults get wrong for us.

Several processes (test workers, runs started together) wait for one another's compiler through the cache; ten seconds
are not enough for that on a busy machine. Importing this module raises the limit.
"""

from functools import wraps

from dolfinx import jit
from ufl import Form

TIMEOUT = 90    # s

jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (TIMEOUT, jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"][1])

# Sums may be reordered and reciprocals shared, which makes the tangent a sixth faster (measured); infinities and NaN keep
# their meaning, since a failed solve is told by them. No -march: minutes of compiling, and no gain.
OPTIONS = ["-O2", "-ffast-math", "-fno-finite-math-only"]

jit.DOLFINX_DEFAULT_JIT_OPTIONS["cffi_extra_compile_args"] = (
    OPTIONS, jit.DOLFINX_DEFAULT_JIT_OPTIONS["cffi_extra_compile_args"][1])


def remembering(compile_form):
    """Compile a form once in a process: one that has been seen, on whatever mesh, is known by its signature.

    dolfinx lists the folder of its cache each time, 2 ms among some thousand files, and a new mesh has four forms or more.
    """
    known = {}

    @wraps(compile_form)
    def remembered(comm, ufl_object, form_compiler_options=None, jit_options=None):
        options = {"form_compiler_options": form_compiler_options, "jit_options": jit_options}
        if not isinstance(ufl_object, Form):
            return compile_form(comm, ufl_object, **options)
        # the first time is collective: what one rank compiles for itself alone does not count for all
        key = ufl_object.signature(), comm.size, str(options)
        if key not in known:
            known[key] = compile_form(comm, ufl_object, **options)
        return known[key]

    return remembered


jit.ffcx_jit = remembering(jit.ffcx_jit)
