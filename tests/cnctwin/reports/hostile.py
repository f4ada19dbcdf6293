"""Data whose every text would like to be markup or script, for the reports of the gap and of the optimisation."""

from dataclasses import fields, is_dataclass, replace
from typing import Any

HOSTILE = "</script><script>alert(1)</script></style><img src=x onerror=alert(2)>\"'&\x00\ud800"


def hostile(value: Any) -> Any:
    """The same with every text replaced by one that would like to be run; keys begin as they were, to stay apart."""
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{f.name: hostile(getattr(value, f.name)) for f in fields(value)})
    if type(value) is str:
        return HOSTILE
    if isinstance(value, tuple):
        return tuple(hostile(part) for part in value)
    return {f"{key} {HOSTILE}": hostile(part) for key, part in value.items()} if isinstance(value, dict) else value
