"""The limits of what a process lets in: the table `[limits]` of the processors' configuration file."""

from dataclasses import fields
from pathlib import Path

from processors.config import read_tables
from processors.errors import ConfigurationError
from sparkplug.admission.limits import DEFAULTS, Limits
from twin.vocabulary.faults import report, unknown

TABLE = "limits"


def limits_of(config_path: Path | None) -> Limits:
    """Return the limits that a configuration file sets, and the defaults of the others. Raises ConfigurationError."""
    table = {} if config_path is None else read_tables(config_path).get(TABLE, {})
    known = [field.name for field in fields(Limits)]
    if faults := [unknown(f"[{TABLE}] {key}", key, known) for key in table if key not in known]:
        raise ConfigurationError(report(config_path, faults))
    try:
        return Limits(**table) if table else DEFAULTS
    except ValueError as error:
        raise ConfigurationError(f"{config_path}: [{TABLE}] {error}") from error
