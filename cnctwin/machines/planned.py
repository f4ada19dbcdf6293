"""The programs that a description plans, kept beside its version: `history/<machine>/<version>.programs.json`.

The live processors compare each section that has run with them. They belong to a version, since another one plans other times.
"""

import json
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.files.called_programs import with_called_programs
from cnctwin.files.program_folder import ProgramFolder
from cnctwin.files.program_text import read_text
from cnctwin.machines import disk
from cnctwin.machines.folder import MachineFolder
from processors.description import Programs
from processors.description_folder import PROGRAMS
from twin.errors import TwinError
from twin.machine import MachineFile
from twin.vocabulary.program_names import program_key

SECONDS_DIGITS = 3


def planned(machine: MachineFile, folder: Path) -> tuple[Programs, list[str]]:
    """Return the seconds of the sections of each program in a folder, and why some could not be planned.

    Raises UsageError where there is no such folder, MachineError where the machine states nothing of how its control moves.
    """
    from twin.motion.sections import section_seconds  # noqa: PLC0415  numpy comes with it

    files: dict[Path, list[str]] = {}
    for name, path in ProgramFolder(folder).programs().items():
        files.setdefault(path, []).append(program_key(name))
    found: Programs = {}
    faults = []
    for path in sorted(files):
        try:
            text = read_text(path)
            seconds = section_seconds(machine, text, with_called_programs(machine.settings, path, text))
        except (TwinError, UsageError) as error:
            if machine.program is None:
                raise
            faults.append(f"{path.name} is not planned: {error}")
        else:
            found |= dict.fromkeys(files[path], tuple(round(one, SECONDS_DIGITS) for one in seconds))
    return found, faults


def keep_planned(of: MachineFolder, version: str, programs: Programs) -> Path:
    """Keep the planned programs of a version; its file. Raises FolderError."""
    path = of.history / f"{version}{PROGRAMS}"
    disk.put(path, json.dumps(programs, indent=1, sort_keys=True) + "\n")
    return path
