"""The four models of what contact does to a body (METHOD 1.1)."""

from enum import StrEnum


class ModelKind(StrEnum):
    """Which model; the values are the names on the command line and in messages."""

    POLYTOPE = "polytope"
    DEEP = "deep"
    DEEPVERTEX = "deepvertex"
    END_TO_END = "end_to_end"
