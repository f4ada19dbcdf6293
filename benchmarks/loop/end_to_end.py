#!/usr/bin/env python3
"""The loop end to end, effect by effect: a production machine on a real broker, from the hour that nobody told to the closed gap.

    .venv/bin/python -m benchmarks.loop.end_to_end [--only EFFECT …] [--seed 7] [--kill PART … | --kill-each]

Each effect has a plant of its own (tests/cnctwin/loop/production_plant.py): Mosquitto, an edge node that tells what
the control shows, `cnctwin process` with thermal and gap, the historian, `cnctwin twin run` that promotes by rule, and
`cnctwin jobs run`.
Hours are those of production. A line is printed for each effect as soon as it is through:

    noticed, live    hours after the effect came until a gap stood open, and until the answer was live; "-" = never
    named, class     the effect is a cause by its name; it is in the class of what a cause cannot be told from
    gap              standing gap of the worst signal as the diagnosis began, and after the promotion, in floors
    made             how often something was made live: once

--kill        kill -9 these parts (historian, processors, jobs, loop, broker, child) as the loop comes to each of its steps, and
              start them again; the child is the one that composes, then the one that diagnoses
--kill-each   the same with one part after the other, each on a plant of its own; a line for each part, with the steps in which it
              was killed
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.cnctwin.loop.production_plant import ProductionPlant
from tests.cnctwin.loop.way_round import WayRound, way_round
from tests.wire.mosquitto import Mosquitto

BROKER, CHILD = "broker", "child"
KILLED = ("processors", "jobs", "loop", BROKER, CHILD, "historian")
CHILD_OF = {"composing": "loop", "diagnosing": "jobs"}
"""The part whose child works in a step."""
TEMPERATURE, LOAD = "spindle_temp_c", "spindle_load_pct"
SIZES: dict[tuple[str, str], dict[str, float]] = {
    ("rated_power", ""): {"scale": 0.5},
    ("coolant_cooling", ""): {"gain": 1.5},
    ("speed_convection", ""): {"gain": 1.5},
    ("second_thermal_mass", ""): {},
    ("sensor_bias", TEMPERATURE): {"bias": 2.0},
    ("sensor_scale", TEMPERATURE): {"scale": 1.2},
    ("sensor_lag", TEMPERATURE): {"time_constant_s": 300.0},
    ("idle_speed_power", ""): {"power_kw": 0.3},
    ("sensor_bias", LOAD): {"bias": 3.0},
    ("sensor_scale", LOAD): {"scale": 2.0},
    ("tool_change_time", ""): {"change_s": 1.0},
}
"""The effects that production signals can show, and the size of each; what is not given is typical."""


def main() -> None:
    """Print a line for each effect."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=())
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--kill", nargs="+", default=(), choices=KILLED)
    parser.add_argument("--kill-each", action="store_true")
    given = parser.parse_args()
    print(
        f"{'effect':<22}{'on':<18}{'size':<24}{'noticed':<9}{'live':<7}{'named':<7}{'class':<7}{'gap':<14}{'made':<6}{'s':<6}text"
    )
    for name, on in SIZES:
        if given.only and name not in given.only:
            continue
        for parts in [[part] for part in KILLED] if given.kill_each else [list(given.kill)]:
            _gone_round(name, on, given.seed, parts)


def _gone_round(name: str, on: str, seed: int, parts: Sequence[str]) -> None:
    """Go round once while these parts are killed, and print how it ended."""
    killed: list[tuple[str, str]] = []
    with TemporaryDirectory(prefix="loop-") as folder, Mosquitto(persistent=True) as broker:
        try:
            found = way_round(Path(folder) / "plant", broker, name, on, SIZES[name, on], seed, killer(broker, parts, killed))
            print(_line(name, on, SIZES[name, on], found), flush=True)
        except AssertionError as error:
            print(f"{name:<22}{on:<18}did not come to an end: {str(error)[:200]}", flush=True)
    for part in parts:
        print(f"    {part} killed in: {', '.join(step for one, step in killed if one == part)}", flush=True)


def killer(broker: Mosquitto, parts: Sequence[str], killed: list[tuple[str, str]]) -> Callable[[ProductionPlant, str], None]:
    """Return what kills these parts, one after the other, and starts them again; `killed` is told which, and in which step."""

    def kill(plant: ProductionPlant, step: str) -> None:
        for part in parts:
            if part == BROKER:
                broker.kill()
                broker.start()
            elif part != CHILD:
                plant.kill(part)
                plant.start(part)
            elif step in CHILD_OF:
                plant.kill_child(CHILD_OF[step])
            else:
                continue
            killed.append((part, step))

    return kill


def _line(name: str, on: str, size: dict[str, float], found: WayRound) -> str:
    sizes = " ".join(f"{key} {value:g}" for key, value in size.items()) or "typical"
    is_named, is_in_class = ((name, on) in some for some in (found.named, found.classes))
    told = f"{_hours(found.noticed_h):<9}{_hours(found.promoted_h):<7}{_yes(is_named):<7}{_yes(is_in_class):<7}"
    told += f"{_hours(found.before)} → {_hours(found.after):<8}{found.promotions:<6}{found.seconds:<6.0f}"
    return f"{name:<22}{on:<18}{sizes:<24}{told}{found.text[:160]}"


def _hours(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _yes(is_so: bool) -> str:
    return "yes" if is_so else "no"


if __name__ == "__main__":
    main()
