"""How much a bag may ask for: every size a file declares is held against these before anything is allocated."""

from dataclasses import dataclass, fields

from contact_curation.errors import InvalidValueError

MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class BagLimits:
    """Bounds on what reading a bag takes; far above what recorders write, far below what a machine has.

    Attributes:
        chunk_bytes: of a chunk or record, stored and unpacked [B].
        message_bytes: of one message [B].
        reorder_bytes: of messages held back to bring overlapping chunks into order of log time [B].
        unpacked_file_bytes: of a storage file that is compressed as a whole, on disk [B].
        fixed_array_length: of fixed-size arrays in message definitions, which decoders unroll.
    """

    chunk_bytes: int = 256 * MEBIBYTE
    message_bytes: int = 64 * MEBIBYTE
    reorder_bytes: int = 512 * MEBIBYTE
    unpacked_file_bytes: int = 256 * 1024 * MEBIBYTE
    fixed_array_length: int = 1 << 16

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) <= 0:
                raise InvalidValueError(field.name, getattr(self, field.name), "a positive number")
