"""Virtual environments and jars of the engines, made once in a scratch folder by pip and Maven.

Each engine has its own environment: Quix Streams pins an older confluent-kafka than the others use, and Flink brings 60 packages.
"""

import subprocess
import sys
import venv
from collections.abc import Sequence
from pathlib import Path

PACKAGES = {
    "plain": ("confluent-kafka>=2.16,<3",),
    "quix": ("quixstreams>=3.28,<4",),
    "flink": ("apache-flink==2.3.0", "setuptools<80"),
}
SHOWN = {"plain": ("confluent-kafka",), "quix": ("quixstreams", "confluent-kafka"), "flink": ("apache-flink",)}
KAFKA_JARS = ("org.apache.kafka:kafka_2.13:4.3.1", "org.apache.logging.log4j:log4j-slf4j-impl:2.24.3")
FLINK_JAR = "org.apache.flink:flink-sql-connector-kafka:5.0.0-2.2"


def logged(command: Sequence[str | Path], log: Path) -> None:
    """Run a command, its output into a file; raise RuntimeError with the last lines if it fails."""
    with log.open("wb") as output:
        code = subprocess.run(command, stdout=output, stderr=subprocess.STDOUT, check=False).returncode
    if code:
        words = " / ".join(log.read_text(errors="replace").strip().splitlines()[-3:])
        raise RuntimeError(f"{' '.join(map(str, command))} ended with {code}: {words}; all of it is in {log}")


def python_of(environment: str, scratch: Path) -> Path:
    """Return the interpreter of an environment, made and filled if it is not there yet."""
    folder = scratch / environment
    python = folder / "bin" / "python"
    stamp = folder / "stream_engines.txt"
    wanted = "\n".join(PACKAGES[environment])
    if not stamp.exists() or stamp.read_text() != wanted:
        sys.stderr.write(f"pip installs {', '.join(PACKAGES[environment])} into {folder}\n")
        venv.create(folder, with_pip=True, clear=True)
        pip = [python, "-m", "pip", "install", "--progress-bar", "off", *PACKAGES[environment]]
        logged(pip, scratch / f"pip-{environment}.log")
        stamp.write_text(wanted)
    return python.absolute()


def versions(environment: str, scratch: Path) -> list[str]:
    """Return name and version of the packages that matter in an environment."""
    code = f"from importlib.metadata import version; print(*(f'{{n}} {{version(n)}}' for n in {SHOWN[environment]}), sep='\\n')"
    told = subprocess.run([python_of(environment, scratch), "-c", code], capture_output=True, text=True, check=True)
    return told.stdout.splitlines()


def jars(name: str, artifacts: Sequence[str], scratch: Path, *, alone: bool = False) -> Path:
    """Return a folder with these jars from Maven Central and, unless they come alone, the jars that they need."""
    folder, pom = scratch / name, scratch / f"{name}.xml"
    without = "<exclusions><exclusion><groupId>*</groupId><artifactId>*</artifactId></exclusion></exclusions>" if alone else ""
    asked = "".join(
        f"<dependency><groupId>{group}</groupId><artifactId>{one}</artifactId><version>{version}</version>{without}</dependency>"
        for group, one, version in (artifact.split(":") for artifact in artifacts)
    )
    head = (
        "<modelVersion>4.0.0</modelVersion><groupId>cnctwin</groupId><artifactId>stream-engines</artifactId><version>1</version>"
    )
    wanted = f"<project>{head}<dependencies>{asked}</dependencies></project>"
    if not folder.is_dir() or not pom.exists() or pom.read_text() != wanted:
        sys.stderr.write(f"Maven fetches {', '.join(artifacts)} into {folder}\n")
        pom.write_text(wanted)
        maven = ["mvn", "-q", "-f", pom.absolute(), "dependency:copy-dependencies", f"-DoutputDirectory={folder.absolute()}"]
        try:
            logged(maven, scratch / f"mvn-{name}.log")
        except RuntimeError:
            pom.unlink()
            raise
    return folder
