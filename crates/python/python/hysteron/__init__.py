"""Recordings of a piezo stage in; a model, what it lacks, and a controller out.

Voltages are in volts, positions in micrometres, sample rates ``fs`` in hertz.

    data = hysteron.Dataset.from_arrays(u, y, fs)
    model = hysteron.fit(data, "mrpi")
    print(hysteron.compare(data, model))
"""

from ._hysteron import (
    Comparison,
    Controller,
    Dataset,
    Diagnosis,
    Error,
    Explanation,
    Ladder,
    Law,
    Learned,
    Model,
    Record,
    __version__,
    add,
    compare,
    design,
    diagnose,
    effects,
    example,
    examples,
    explain,
    fit,
    ladder,
    learn,
    read,
    simulate,
)
from . import fleet
from ._show import Page

__all__ = [
    "Comparison",
    "Controller",
    "Dataset",
    "Diagnosis",
    "Error",
    "Explanation",
    "Ladder",
    "Law",
    "Learned",
    "Model",
    "Page",
    "Record",
    "__version__",
    "add",
    "compare",
    "design",
    "diagnose",
    "effects",
    "example",
    "examples",
    "explain",
    "fit",
    "fleet",
    "ladder",
    "learn",
    "read",
    "simulate",
]
