"""Engines for keyed folds with exactly-once on Kafka, compared: what they cost, and what a kill -9 does.

    python -m benchmarks.stream_engines                             # plain, thin, quix and flink: about 40 minutes
    python -m benchmarks.stream_engines --engines plain,thin,quix --rounds 1 --kills 1

See the docstring of the package for what is measured. Needs Linux, Java 17, Maven, pip and 3 GB of disk (1 GB without flink).
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.stream_engines.environments import FLINK_JAR, KAFKA_JARS, jars, python_of, versions
from benchmarks.stream_engines.kafka_broker import KafkaBroker

ROOT = Path(__file__).parents[2]
ENGINES = ("plain", "thin", "quix", "flink")


def options() -> argparse.Namespace:
    """Return what was asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", default=",".join(ENGINES), help=f"Which of {', '.join(ENGINES)}, with commas")
    parser.add_argument("--scratch", type=Path, default=Path(".cache/stream_engines"), help="Folder of environments and jars")
    parser.add_argument("--messages", type=int, default=100_000, help="Messages of a measurement of processor time")
    parser.add_argument("--rounds", type=int, default=3, help="Measurements of processor time of each engine and size of state")
    parser.add_argument("--kills", type=int, default=3, help="Kills and takeovers of each engine")
    parser.add_argument("--paced", type=int, default=60_000, help="Messages of a trial with a kill")
    parser.add_argument("--per-second", type=float, default=4000.0, help="Their rate")
    parser.add_argument("--commit-seconds", type=float, default=0.2, help="Commit interval of thin, quix-stable and flink")
    parser.add_argument("--kafka", default="", help="Bootstrap address of a running broker instead of one of its own")
    asked = parser.parse_args()
    asked.engines = asked.engines.split(",")
    if unknown := set(asked.engines) - set(ENGINES):
        parser.error(f"--engines: {', '.join(sorted(unknown))} is none of {', '.join(ENGINES)}")
    return asked


def conditions(asked: argparse.Namespace, environments: list[str]) -> str:
    """Return versions, machine and command, for below the table."""
    told = [version for name in environments for version in versions(name, asked.scratch)]
    told += [KAFKA_JARS[0].split(":", 1)[1].replace(":", " "), f"Python {sys.version.split()[0]}"]
    if "flink" in environments:
        told.append(FLINK_JAR.split(":", 1)[1].replace(":", " "))
    machine = f"{os.cpu_count()} cores, load {', '.join(f'{one:.1f}' for one in os.getloadavg())} at the end"
    command = " ".join(["python -m benchmarks.stream_engines", *sys.argv[1:]])
    return f"\n{', '.join(dict.fromkeys(told))}; {machine}.\nCommand: `{command}`\n"


def main() -> int:
    """Make the environments, start a broker, compare, and print the table."""
    asked = options()
    asked.scratch.mkdir(parents=True, exist_ok=True)
    pythons = {"plain": str(python_of("plain", asked.scratch))}
    jar, refused = "", list[str]()
    for name in {"quix", "flink"} & set(asked.engines):
        try:
            python = python_of(name, asked.scratch)
            if name == "flink":
                jar = str(next(jars("flink-jars", [FLINK_JAR], asked.scratch, alone=True).glob("*.jar")).absolute())
            pythons[name] = str(python)
        except (RuntimeError, OSError) as failure:
            refused.append(f"{name} could not be installed, so it has no figures: {failure}")
            asked.engines.remove(name)
    folder = Path(tempfile.mkdtemp(dir=asked.scratch, prefix="run-")).absolute()

    def compare(kafka: str) -> int:
        extent = {"messages": asked.messages, "rounds": asked.rounds, "kills": asked.kills, "paced": asked.paced}
        told = {"kafka": kafka, "folder": str(folder), "engines": asked.engines, "pythons": pythons, "jar": jar}
        told |= {"commit_s": asked.commit_seconds, "extent": {**extent, "per_s": asked.per_second}}
        command = [pythons["plain"], "-m", "benchmarks.stream_engines.comparison", json.dumps(told)]
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
        return subprocess.run(command, env=environment, check=False).returncode

    if asked.kafka:
        code = compare(asked.kafka)
    else:
        with KafkaBroker(jars("kafka-jars", KAFKA_JARS, asked.scratch), folder / "kafka") as broker:
            code = compare(broker.address)
    if code:
        sys.stderr.write(f"The comparison ended with {code}; the logs are in {folder}\n")
        return code
    sys.stdout.write("".join(f"\n{line}\n" for line in refused) + conditions(asked, list(pythons)))
    shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
