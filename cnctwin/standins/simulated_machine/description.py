"""The files that describe the simulated machine, and what it takes to simulate it."""

from importlib.util import find_spec
from pathlib import Path

from cnctwin.errors import UsageError

FOLDER = Path(__file__).parent
PROGRAM = FOLDER / "base_plate.nc"
TOLD = FOLDER / "machine.toml"
AS_BUILT = FOLDER / "as_built.toml"
TOOLS = FOLDER / "tools.toml"
DEVICES = FOLDER / "devices.xml"
PROCESSORS = FOLDER / "processors.toml"
SPARE_PART = FOLDER / "spare_part.txt"
ANOMALY_MODEL = FOLDER / "model"
NEEDED = ("numpy", "scipy", "numba", "pyarrow")
SPEED_MAX = 200.0
"""Beyond it nothing but the wait for the next part would be seen."""


def program_text() -> str:
    """The part program."""
    return PROGRAM.read_text(encoding="utf-8")


def description_text() -> str:
    """Return the live twin's description: the machine with the tools of its program, as `machines/<name>.toml` holds it."""
    return f"{TOLD.read_text(encoding='utf-8')}\n{TOOLS.read_text(encoding='utf-8')}"


def check(speed: float) -> None:
    """Raises UsageError where the machine cannot be simulated at this speed, or not at all. Looks packages up, imports none."""
    if not 0.0 < speed <= SPEED_MAX:
        raise UsageError(f"--speed {speed:g} is not above 0 and up to {SPEED_MAX:g}; 1 is real time, 20 twenty times as fast")
    if absent := [name for name in NEEDED if find_spec(name) is None]:
        raise UsageError(f"the simulated machine needs {', '.join(absent)}; pip install 'cnctwin[twin]' brings them")
