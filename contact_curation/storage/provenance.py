"""Where a toss came from, byte for byte."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TossProvenance:
    """The recording a toss was cut from.

    Attributes:
        input: path of the bag or file; empty for a toss that came live.
        input_sha256: of its bytes (`BagReader.sha256`); empty for a toss that came live.
        topic: the pose topic; empty where the input has none.
    """

    input: str = ""
    input_sha256: str = ""
    topic: str = ""
