"""The markers and lives of a partition as they were saved, checked: a topic of a cluster may hold anything."""

from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from processors.errors import SnapshotError

_Offset = Annotated[int, Field(ge=0)]
_T = TypeVar("_T", bound=BaseModel)


class _Kept(BaseModel):
    model_config = ConfigDict(frozen=True, strict=True)


class KeptMarker(_Kept):
    """The places of a reader: of each processor the offset at which its states were cut, and that up to which its results went
    out."""

    processors: dict[str, Annotated[list[_Offset], Field(min_length=2, max_length=2)]]


class KeptLives(_Kept):
    """The messages that were there already, by device and node, up to the offset `folded`; and who wrote the newest ones of each
    device."""

    folded: _Offset
    devices: dict[str, dict[str, Annotated[list[int], Field(min_length=3)]]]
    writers: dict[str, str] = {}


def read(model: type[_T], key: str, value: bytes) -> _T:
    """Return what stands under a key. Raises SnapshotError, which names the key."""
    try:
        return model.model_validate_json(value)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise SnapshotError(f"{key}: {place + ': ' if place else ''}{first['msg']} (got {value[:40]!r})") from None
