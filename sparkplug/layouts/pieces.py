"""The pieces that the messages of one layout are cut into by whoever hands them on under other names."""

from dataclasses import dataclass
from struct import Struct

from sparkplug.datatype import DataType


@dataclass(slots=True)
class Pieces:
    """The payload's time stamp, of each metric all but alias and name, and the sequence number.

    sizes: of the metrics' pieces, bytes; types: what the birth said of each metric, None where the piece says it; template: the
    bytes between the pieces as somebody writes them, who leaves them here
    """

    cut: Struct
    sizes: tuple[int, ...]
    types: tuple[DataType | None, ...]
    template: bytes = b""
