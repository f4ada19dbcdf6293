"""The loss of a model at each moment of a stretch, by kind.

| kind | loss |
|---|---|
| residual | (measured − (physics + correction))², K²; outside its region a model corrects nothing, and the physics alone counts |
| anomaly | 1 where an alarm comes on, else 0, on time that somebody states to be healthy: false alerts at the own threshold |

A detector has none: what is right is known only where a control tells its tool changes, and then no detector is needed.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cnctwin.challenge.contest import Losses
from cnctwin.errors import UsageError
from cnctwin.validation.track import Floats
from twin.errors import TwinError
from twin.runlog import RunLog

Loss = Callable[[Path, RunLog, str], tuple[Floats, Floats, float]]
"""Folder of the version, stretch, machine → times (n,), loss (n,), s between two moments."""


def losses(kind: str, models: tuple[Path, Path], log: RunLog, machine: str) -> Losses:
    """Return the losses of champion and challenger, at the same moments. Raises UsageError where they cannot be judged."""
    loss = LOSSES.get(kind)
    if loss is None:
        raise UsageError(
            f"models of kind {kind} are not compared; there are {', '.join(LOSSES)}: promote one with --because and the reason"
        )
    try:
        (one_s, one, every_s), (other_s, other, _) = (loss(folder, log, machine) for folder in models)
    except TwinError as error:
        raise UsageError(str(error)) from None
    times = np.union1d(one_s, other_s)
    first = times[0] if len(times) else 0.0
    count = round((times[-1] - first) / every_s) + 1 if len(times) else 0
    return Losses(_spread(one_s, one, first, every_s, count), _spread(other_s, other, first, every_s, count), every_s)


def _spread(t_s: Floats, loss: Floats, first_s: float, every_s: float, count: int) -> Floats:
    """On even times, NaN where there is none."""
    even = np.full(count, np.nan)
    even[np.rint((t_s - first_s) / every_s).astype(np.int64)] = loss
    return even


def residual(folder: Path, log: RunLog, _machine: str) -> tuple[Floats, Floats, float]:
    """Squared error of the corrected temperature."""
    from twin.residual import losses as squared  # noqa: PLC0415  each kind brings its own

    t_s, loss = squared.losses(folder, log)
    return t_s, loss, squared.ROW_S


def anomaly(folder: Path, log: RunLog, machine: str) -> tuple[Floats, Floats, float]:
    """Alarms that come on, of the machine alone: its peers are not in a stretch of one machine."""
    from cnctwin.training.anomaly.frozen_week import segments  # noqa: PLC0415
    from cnctwin.training.anomaly.replayed_cell import replayed  # noqa: PLC0415
    from processors.joint_anomaly.config import FITTED_WITH  # noqa: PLC0415
    from twin.anomaly.alarm import is_alarm, onsets  # noqa: PLC0415
    from twin.anomaly.model import load_model  # noqa: PLC0415

    model = load_model(folder)
    found = model.calibration
    if found is None:
        raise UsageError(f"{folder}: has no threshold, so no alerts to count: cnctwin train anomaly fits one")
    settings = {name: getattr(found, name) for name in FITTED_WITH}
    at_zero = RunLog(log.t_s - log.t_s[0], log.columns, log.text, (), log.source)
    track = replayed({machine: at_zero}, {machine: model}, {**settings, "threshold": 1.0})[machine]
    rule = found.rule
    loss = np.where(np.isfinite(track.adjusted) & ~track.skipped, 0.0, np.nan)
    for piece in segments(track, found.tick_s):
        begun = onsets(is_alarm(rule, track.adjusted[piece], track.skipped[piece]))
        loss[piece.start + np.asarray(begun, dtype=np.int64)] = 1.0
    return track.t_s, loss, found.tick_s


LOSSES: dict[str, Loss] = {"residual": residual, "anomaly": anomaly}
