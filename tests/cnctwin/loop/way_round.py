"""One way round the loop on a production plant: an effect that nobody told is noticed, diagnosed, and the answer made live."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cnctwin.standins.simulated_machine.as_built import machine_as_built
from tests.cnctwin.loop.production_plant import HEALTHY_HOURS, ProductionPlant, with_effect
from tests.wire.mosquitto import Mosquitto

UNTOLD_HOURS = 0.62
"""After the healthy period: when the effect comes."""
NOTICED_HOURS, ANSWERED_HOURS, PROMOTED_HOURS, CLOSED_HOURS = 16.0, 10.0, 6.0, 4.0
"""The most that each may take, in hours of production."""
CLOSED_FLOORS = 1.3
SIGNALS = ("spindle_temp_c", "spindle_load_pct", "tool_change_s")
Found = tuple[str, str]


@dataclass(frozen=True, slots=True)
class WayRound:
    """The outcome of an effect; None = it did not come so far. noticed_h, promoted_h: hours of production since it came

    named: the causes; classes: what they cannot be told from; before, after: the standing gap of the worst signal, in floors
    text: what the loop said last; promotions: how often something was made live
    """

    noticed_h: float | None = None
    promoted_h: float | None = None
    named: tuple[Found, ...] = ()
    classes: tuple[Found, ...] = ()
    before: float | None = None
    after: float | None = None
    promotions: int = 0
    text: str = ""
    seconds: float = 0.0


def way_round(
    folder: Path, broker: Mosquitto, name: str, on: str, parameters: dict[str, float], seed: int = 7,
    in_step: Callable[[ProductionPlant, str], None] = lambda _plant, _step: None,
) -> WayRound:  # fmt: skip
    """Go round once. in_step: is called as the plant comes to each step of the loop, once: for whoever kills parts of it"""
    began_s, healthy, machine = time.monotonic(), machine_as_built(), with_effect(name, on, **parameters)
    noticed_h = promoted_h = before = after = None
    with ProductionPlant(folder, broker.port, seed) as plant:
        plant.in_step = lambda step: in_step(plant, step)
        plant.work(healthy, HEALTHY_HOURS + UNTOLD_HOURS)
        plant.look(1.0)
        noticed_h = plant.work_until(machine, lambda: plant.document.get("open"), NOTICED_HOURS)
        if noticed_h is not None:
            in_step(plant, "watching")
            answered_h = plant.work_until(machine, lambda: plant.document.get("step") != "watching", ANSWERED_HOURS)
            before = _worst(plant)
            waited_h = plant.work_until(machine, lambda: plant.steps("promoted"), PROMOTED_HOURS)
            if answered_h is not None and waited_h is not None:
                promoted_h = noticed_h + answered_h + waited_h
        told = plant.document.get("challenger") or {}
        causes = told.get("causes") or [cause for step in plant.steps("filed") for cause in plant.causes(step.version)]
        if promoted_h is not None:
            plant.work(machine, 0.5)  # the figures begin again
            plant.work_until(machine, lambda: _worst(plant) < CLOSED_FLOORS, CLOSED_HOURS)
            after = _worst(plant)
        return WayRound(
            noticed_h=noticed_h,
            promoted_h=promoted_h,
            named=tuple((one["effect"], one["on"]) for one in causes),
            classes=tuple((e["effect"], e["on"]) for one in causes for e in one["indistinguishable_from"]),
            before=before,
            after=after,
            promotions=len(plant.steps("promoted")),
            text=str(plant.document.get("text", "")),
            seconds=time.monotonic() - began_s,
        )


def _worst(plant: ProductionPlant) -> float:
    return max(plant.gap(signal) for signal in SIGNALS)
