"""Champion against challenger on a holdout that neither was trained on, and on the golden week."""

import hashlib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from cnctwin.challenge.contest import HOURS_MIN, TOLERANCE, Losses, Outcome, outcome
from cnctwin.challenge.losses import losses
from cnctwin.errors import UsageError
from cnctwin.models.card import Card
from cnctwin.models.golden import golden_of
from cnctwin.models.registry import Shelf, keep_comparison
from twin.models.pointer import seconds
from twin.runlog import RunLog

DATED_S = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class Test:
    """The data and bounds that both are judged by.

    logs: the holdout, stretch by stretch; sha256: of its files (none of a store's)
    tolerance: on the golden week, 0.05 = 5 %; hours_min: that the holdout has to have
    """

    logs: tuple[RunLog, ...]
    sha256: tuple[str, ...]
    tolerance: float = TOLERANCE
    hours_min: float = HOURS_MIN


def compared(own: Shelf, version: str, test: Test, now_s: float) -> tuple[str, Outcome, list[str]]:
    """The challenger's version, who wins, and what is to be said; it is written down. Raises UsageError."""
    challenger = own.named(version)
    pointer = own.pointer()
    if pointer is None:
        raise UsageError(
            f"{own.kind} of {own.machine}: there is no champion to be compared with; cnctwin model promote makes one"
        )
    if pointer.champion == challenger.name:
        raise UsageError(f"{own.kind} of {own.machine}: {challenger.name} is the champion")
    champion = own.folder / pointer.champion
    notes = [note for card in (own.card(champion.name), own.card(challenger.name)) for note in _seen(card, test)]
    judged = _together([losses(own.kind, (champion, challenger), log, own.machine) for log in test.logs])
    golden = golden_of(own)
    week = None if golden is None else losses(own.kind, (champion, challenger), golden[0], own.machine)
    if golden is not None and golden[1]["sha256"] in {own.card(name).data_sha256 for name in (champion.name, challenger.name)}:
        notes.append("the golden week is what one of them was trained on, so that it speaks for that one")
    found = outcome(judged, week, tolerance=test.tolerance, hours_min=test.hours_min)
    told: dict[str, Any] = {
        "at": datetime.fromtimestamp(now_s, UTC).isoformat(timespec="seconds"),
        "champion": champion.name,
        "challenger": challenger.name,
        "holdout": [log.source for log in test.logs],
        "golden": None if golden is None else golden[1]["sha256"],
        "tolerance": test.tolerance,
        "notes": notes,
        **found.as_json(),
    }
    keep_comparison(own, told)
    return challenger.name, found, notes


def won(own: Shelf, version: str, comparisons: list[dict[str, Any]]) -> bool:
    """Return True if the last comparison of this version with the present champion was won."""
    pointer = own.pointer()
    champion = None if pointer is None else pointer.champion
    last = [one for one in comparisons if one.get("challenger") == version and one.get("champion") == champion]
    return bool(last and last[-1].get("wins"))


def _seen(card: Card, test: Test) -> list[str]:
    """Return notes on how a model was trained. Raises UsageError where it was trained on what it is to be judged on."""
    notes: list[str] = []
    if card.data_sha256 and card.data_sha256 in test.sha256:
        raise UsageError(f"{card.version} was trained on this very data: judge on time that neither model has seen")
    for log in test.logs:
        trained = _span_s(card)
        if trained is not None and log.t_s[0] > DATED_S and trained[0] < log.t_s[-1] and log.t_s[0] < trained[1]:
            raise UsageError(
                f"{card.version} was trained from {card.from_} to {card.to}, and {log.source} lies in that: "
                "judge on time that neither model has seen"
            )
        if Path(log.source).name in {Path(name).name for name in card.source}:
            raise UsageError(f"{card.version} was trained on {Path(log.source).name}: judge on time that neither model has seen")
        if trained is None or log.t_s[0] <= DATED_S:
            notes.append(f"whether {card.version} was trained on {Path(log.source).name} cannot be told from their times")
    return notes


def _span_s(card: Card) -> tuple[float, float] | None:
    """From and to, where they count from 1970."""
    try:
        return seconds(card.from_), seconds(card.to)
    except ValueError:
        return None


def _together(parts: list[Losses]) -> Losses:
    """One after the other, with a moment of nothing between them."""
    if not parts:
        raise UsageError("no holdout is given: --runs FILE, or --from and --to of a store")
    gap = np.array([np.nan])
    return Losses(
        np.concatenate([piece for part in parts for piece in (part.champion, gap)]),
        np.concatenate([piece for part in parts for piece in (part.challenger, gap)]),
        parts[0].every_s,
    )


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file. Raises UsageError where there is none."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
