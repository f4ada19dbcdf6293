"""The folder of a plant: what `cnctwin init` writes and `cnctwin up` runs.

edges/<machine>.toml      how its control is read
machines/<machine>.toml   what the machine is
processors.toml           how the processors run
plant.env                 addresses: CNCTWIN_BROKER (empty: a private one)
secrets/plant.env         passwords and tokens, mode 600
state, store, models      what the processes keep
"""

import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from cnctwin.errors import UsageError


@dataclass(frozen=True, slots=True)
class PlantFolder:
    """The places in the folder of a plant."""

    root: Path

    @property
    def edges(self) -> Path:
        """The folder of the edges' files."""
        return self.root / "edges"

    @property
    def machines(self) -> Path:
        """The folder of the descriptions."""
        return self.root / "machines"

    @property
    def processors(self) -> Path:
        """The configuration of the processors."""
        return self.root / "processors.toml"

    @property
    def addresses(self) -> Path:
        """The file of the addresses."""
        return self.root / "plant.env"

    @property
    def secrets(self) -> Path:
        """The file of passwords and tokens."""
        return self.root / "secrets" / "plant.env"

    @property
    def state(self) -> Path:
        """The folder in which the processes keep what has to survive a restart."""
        return self.root / "state"

    @property
    def unit(self) -> Path:
        """The systemd unit."""
        return self.root / "cnctwin.service"

    def environment(self) -> dict[str, str]:
        """Return the variables of both files. Raises UsageError where one cannot be read, or others may read the secrets."""
        if self.secrets.exists() and stat.S_IMODE(self.secrets.stat().st_mode) & 0o077:
            raise UsageError(f"{self.secrets}: others than its owner may use it; chmod 600 {self.secrets}")
        return {**variables(self.addresses), **variables(self.secrets)}


def variables(path: Path) -> dict[str, str]:
    """Return the variables of a file of lines NAME=VALUE; none where it is not there. Raises UsageError."""
    found = {}
    try:
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read: {error}") from None
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        name, given, value = line.partition("=")
        if not given or not name.strip().isidentifier():
            raise UsageError(f"{path}: line {number} is not NAME=VALUE")
        found[name.strip()] = value.strip().strip('"')
    return found


def with_variables(text: str, values: Mapping[str, str]) -> str:
    """Return a file's text with these variables set; those that are in it are changed in place.

    >>> with_variables("# ours\\nA=1\\nB=2\\n", {"B": "3", "C": "4"})
    '# ours\\nA=1\\nB=3\\nC=4\\n'
    """
    lines, left = [], dict(values)
    for line in text.splitlines():
        name = line.partition("=")[0].strip()
        lines.append(f"{name}={left.pop(name)}" if name in left else line)
    return "".join(f"{line}\n" for line in [*lines, *(f"{name}={value}" for name, value in left.items())])
