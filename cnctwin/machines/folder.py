"""The folder of descriptions, `machines/`, as plants keep it:

    <name>.toml                       the live description of machine <name>
    challengers/<name>.toml           one that runs beside it, if any
    history/<name>/<version>.toml     every version that was ever one of them; <version>.json: its evidence
    history/<name>/steps.jsonl        how it came about (cnctwin/machines/step_log.py)

Reading takes no lock, since each file is replaced as a whole; cnctwin/machines/change.py changes them.
"""

from functools import lru_cache
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.machines import disk
from cnctwin.machines.evidence import Card, Shadow, read_card, read_shadow
from cnctwin.machines.step_log import Step, read_steps
from processors.description import Description, version_of

CHALLENGERS, HISTORY = "challengers", "history"
NAME_MAX = 200


class MachineFolder:
    """The files that belong to one machine."""

    def __init__(self, folder: Path, machine: str) -> None:
        if not machine or len(machine) > NAME_MAX or machine.startswith(".") or set("/\\\0") & set(machine):
            raise UsageError(f"machine {machine[:80]!r} cannot name a file: it has no slash and begins with no dot")
        self.folder, self.machine = folder, machine
        self.live_file = folder / f"{machine}.toml"
        self.challenger_file = folder / CHALLENGERS / f"{machine}.toml"
        self.history = folder / HISTORY / machine
        self.log = self.history / "steps.jsonl"
        self.pending_file = self.history / "pending.json"
        self.shadow_file = self.history / "shadow.json"

    def live(self) -> Description | None:
        """The live description; None where nobody has described the machine. Raises MachineError where the file is wrong."""
        return self._description(self.live_file)

    def challenger(self) -> Description | None:
        """The challenger; None where there is none. Raises MachineError where the file is wrong."""
        return self._description(self.challenger_file)

    def live_version(self) -> str:
        """The version of the live file, right or wrong; empty where there is none."""
        return _version(self.live_file)

    def challenger_version(self) -> str:
        """The version of the challenger's file, right or wrong; empty where there is none."""
        return _version(self.challenger_file)

    def steps(self) -> tuple[Step, ...]:
        """All steps, oldest first."""
        return read_steps(self.log)

    def version_file(self, version: str) -> Path:
        """The file of a version in the history."""
        return self.history / f"{version}.toml"

    def named(self, version: str) -> str:
        """Return the version of the history that begins with these digits. Raises UsageError where none or several do."""
        there = sorted(path.stem for path in self.history.glob("*.toml"))
        found = [one for one in there if version and one.startswith(version)]
        if len(found) != 1:
            known = ", ".join(there) or "none"
            raise UsageError(f"{self.machine}: {len(found)} versions begin with {version!r}; the history has {known}")
        return found[0]

    def card(self, version: str) -> Card | None:
        """The evidence for a version; None where nobody has kept any."""
        return read_card(disk.json_of(self.history / f"{version}.json")) if version else None

    def shadow(self) -> Shadow | None:
        """The challenger as a shadow, as the loop last saw it."""
        return read_shadow(disk.json_of(self.shadow_file))

    def _description(self, file: Path) -> Description | None:
        text = disk.text_of(file)
        return None if text is None else _parsed(text, str(file))


@lru_cache(maxsize=1000)
def _parsed(text: str, source: str) -> Description:
    return Description.from_toml(text, source)


def described(folder: Path) -> tuple[str, ...]:
    """Return the names of all machines that the folder describes, or has a challenger of."""
    found = {path.stem for place in (folder, folder / CHALLENGERS) for path in place.glob("*.toml")}
    return tuple(sorted(name for name in found if not name.startswith(".")))


def _version(file: Path) -> str:
    text = disk.text_of(file)
    return "" if text is None else version_of(text)
