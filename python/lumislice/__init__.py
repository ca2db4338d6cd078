"""Stacks of resins, and the light they scatter: lumislice for Python.

Lengths are millimetres, spatial frequencies rad/mm. Whatever takes time takes ``progress``, a function of
``(stage, done, steps)``, and stops at Ctrl-C. What was asked wrongly raises :class:`InputError` with the words of the
command line, what cannot be written :class:`OSError`.
"""

from ._lumislice import (
    InputError,
    Materials,
    __version__,
    factor,
    gamut,
    look,
    match,
    materials,
    measure,
    predict,
    slice,
)

__all__ = [
    "InputError",
    "Materials",
    "__version__",
    "factor",
    "gamut",
    "look",
    "match",
    "materials",
    "measure",
    "predict",
    "slice",
]
