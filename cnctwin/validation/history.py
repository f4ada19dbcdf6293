"""The nights that were judged, one line of JSON each in `<folder>/<machine>.jsonl`, and whether they call for retraining.

Two nights in a row over the budget of the same figure call for it. A night without data for a figure breaks no row and makes
none; a night within the budget ends one; a twin that was changed begins again. A night that is judged again takes the place of
the line that it had. The file holds the newest NIGHTS_MAX nights.
"""

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from cnctwin.errors import UsageError
from edge.state_dir import state_dir

NIGHTS_MAX = 400
IN_A_ROW = 2
LINE_BYTES_MAX = 1_000_000
Night = Mapping[str, Any]


def default_folder() -> Path:
    """Return the folder where nights are kept, if nothing else is said."""
    return state_dir() / "validation"


def file_of(machine: str, folder: Path) -> Path:
    """The file of a machine, whatever characters are in its name."""
    return folder / f"{quote(machine, safe=' ')}.jsonl"


def nights_of(machine: str, folder: Path) -> list[dict[str, Any]]:
    """All nights of a machine, oldest first; a line that is torn or none of ours is passed over."""
    try:
        lines = file_of(machine, folder).read_text(encoding="utf-8").splitlines()[-NIGHTS_MAX:]
    except (FileNotFoundError, UnicodeDecodeError):
        return []
    except OSError as error:
        raise UsageError(f"{file_of(machine, folder)}: cannot be read: {error.strerror}") from None
    nights = [one for line in lines if len(line) <= LINE_BYTES_MAX and isinstance(one := _parsed(line), dict)]
    known = [one for one in nights if isinstance(one.get("night"), str) and isinstance(one.get("figures"), list)]
    return sorted(known, key=lambda one: str(one["night"]))


def kept(night: Night, machine: str, folder: Path) -> list[dict[str, Any]]:
    """The nights with this one among them, after they were written in one move. Raises UsageError where they cannot be."""
    nights = [one for one in nights_of(machine, folder) if one["night"] != night["night"]]
    nights = sorted([*nights, dict(night)], key=lambda one: str(one["night"]))[-NIGHTS_MAX:]
    path = file_of(machine, folder)
    text = "".join(f"{json.dumps(one, ensure_ascii=False, allow_nan=False)}\n" for one in nights)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=folder, prefix=".nights.", delete=False) as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(file.name, path)  # noqa: PTH105  Path.replace would do the same
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
    return nights


def rows(nights: Sequence[Night]) -> dict[str, list[str]]:
    """Figure → the nights in a row, up to the newest, on which it was over its budget.

    >>> def night(day, verdict, twin="a"):
    ...     return {"night": day, "twin": twin, "figures": [{"quantity": "force", "measure": "mape", "verdict": verdict}]}
    >>> rows([night("1", "over"), night("2", "not enough data"), night("3", "over")])
    {'force_mape': ['1', '3']}
    >>> rows([night("1", "over"), night("2", "within"), night("3", "over", "b")])
    {'force_mape': ['3']}
    """
    over: dict[str, list[str]] = {}
    twin: Any = None
    for night in nights:
        if night.get("twin") != twin:
            over, twin = {}, night.get("twin")
        for figure in night["figures"]:
            key, verdict = key_of(figure), figure.get("verdict")
            if verdict == "over":
                over.setdefault(key, []).append(str(night["night"]))
            elif verdict == "within":
                over.pop(key, None)
    return over


def key_of(figure: Mapping[str, Any]) -> str:
    """The name of a figure and what it is of."""
    name = f"{figure.get('quantity')}_{figure.get('measure')}"
    return f"{name}/{figure['on']}" if figure.get("on") else name


def retraining(nights: Sequence[Night]) -> str | None:
    """Why the twin has to be trained again; None where it has not."""
    called = {key: days for key, days in rows(nights).items() if len(days) >= IN_A_ROW}
    if not called:
        return None
    said = [f"{key} over its budget on {' and '.join(days[-IN_A_ROW:])}" for key, days in sorted(called.items())]
    return "; ".join(said)


def validation_of(machine: str, folder: Path, nights: int = 30) -> dict[str, Any]:
    """Return the validation of a machine: its newest night, those before it, and whether it has to be trained again.

    `t` is None and there are no figures where it was never judged.
    """
    known = nights_of(machine, folder)
    newest: Night = known[-1] if known else {}
    reason = retraining(known)
    return {
        "machine": machine,
        "t": newest.get("t"),
        "verdict": newest.get("verdict"),
        "figures": newest.get("figures", []),
        "nights": known[-nights:] if nights > 0 else [],
        "retrain": reason is not None,
        "retrain_reason": reason,
        "over_in_a_row": {key: len(days) for key, days in rows(known).items()},
    }


def _parsed(line: str) -> Any:
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return None
