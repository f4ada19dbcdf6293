"""The place of the folder of descriptions: beside the configuration, or as the environment names it."""

import os
from pathlib import Path

VARIABLE = "CNCTWIN_MACHINES"
NAME = "machines"


def machines_folder(given: Path | None = None, config: Path | None = None) -> Path | None:
    """Return the folder that was given; else `machines` beside the configuration file, $CNCTWIN_MACHINES, or ./machines.

    None where there is none of them.

    >>> machines_folder(Path("plant/machines")).as_posix()
    'plant/machines'
    """
    if given is not None:
        return given
    beside = None if config is None else config.parent / NAME
    if beside is not None and beside.is_dir():
        return beside
    if named := os.environ.get(VARIABLE):
        return Path(named)
    return Path(NAME) if Path(NAME).is_dir() else None


def diagnoses_folder(machines: Path | None) -> Path | None:
    """Return the folder in which the loop files diagnoses for the page, where nobody names another one.

    >>> diagnoses_folder(Path("machines")).as_posix()
    'machines/diagnoses'
    """
    return None if machines is None else machines / "diagnoses"
