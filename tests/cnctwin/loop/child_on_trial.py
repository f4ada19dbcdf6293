"""A child of the loop that composes and judges in no time, and waits where a file says so: `hold-compose`, `hold-judge`."""

import json
import sys
import time
from dataclasses import asdict
from pathlib import Path

from cnctwin.jobs.durable import write_json
from cnctwin.loop.workshop import Paths
from cnctwin.loop.world import Finding
from cnctwin.machines.evidence import Card, Score
from processors.description import version_of

CASE = """[case]
name = "{case}"
machine = "machine.toml"
[[runs]]
file = "run.csv"
kind = "air"
role = "fit"
"""


def main() -> None:
    """See the module."""
    order = json.loads(sys.stdin.read())
    paths = Paths(Path(order["folder"]), order["case"])
    while (paths.folder / f"hold-{order['do']}").exists():
        time.sleep(0.02)
    if order["do"] == "compose":
        part = paths.folder / f".{order['case']}"
        part.mkdir(exist_ok=True)
        (part / "run.csv").write_text("t_s,spindle_rpm\n0.0,0.0\n")
        (part / "machine.toml").write_text(order["description"])
        (part / "case.toml").write_text(CASE.format(**order))
        part.rename(paths.case)
        return
    toml = (Path(order["result"]) / "twin.toml").read_text()
    score = Score(live=3.1, challenger=1.1, runs=2, against=version_of(order["description"]))
    card = Card(sentence="coolant cools", says="coolant cools", signal="spindle_temp_c", words="the temperature", score=score)
    write_json(paths.finding, asdict(Finding(True, "coolant cools", toml)) | {"card": card.model_dump(mode="json")})


if __name__ == "__main__":
    main()
