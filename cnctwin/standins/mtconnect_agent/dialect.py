"""The two generations of the C++ agent that are in the field: what they answer differently.

Measured on agents 1.4.0.12 and 2.3.0.8: agent 1.4 answers errors with HTTP 200, streams as multipart/x-mixed-replace and
hands stamps and numbers on as the adapter wrote them; agent 2.3 answers 400 and 404, streams as multipart/mixed, cuts
stamps to microseconds and reads samples as numbers.
"""

from dataclasses import dataclass
from enum import StrEnum


class Style(StrEnum):
    """The generation of the agent to be."""

    V1_4 = "1.4"
    V2_3 = "2.3"


@dataclass(frozen=True)
class Dialect:
    """The dialect of one generation. `schema` is the version in the namespace, such as (2, 3)."""

    style: Style
    schema: tuple[int, int]

    @property
    def is_modern(self) -> bool:
        """Agent 2.x: real status codes, numbers read as numbers, microsecond stamps."""
        return self.style is Style.V2_3

    @property
    def schema_text(self) -> str:
        return f"{self.schema[0]}.{self.schema[1]}"

    @property
    def multipart_type(self) -> str:
        return "multipart/mixed" if self.is_modern else "multipart/x-mixed-replace"

    def status(self, honest: int) -> int:
        """Return the status that this generation gives where `honest` is meant."""
        return honest if self.is_modern else 200


def dialect(style: str, schema_version: str | None = None) -> Dialect:
    """Return the dialect of a style, with its own schema version or another one.

    >>> dialect("1.4").schema_text, dialect("2.3", "1.8").schema_text
    ('1.4', '1.8')
    """
    chosen = Style(style)
    major, _, minor = (schema_version or chosen.value).partition(".")
    if not (major.isdigit() and minor.isdigit()):
        raise ValueError(f"schema version {schema_version!r} is not of the form 1.4 or 2.3")
    return Dialect(chosen, (int(major), int(minor)))
