"""A language of notifications: a TOML file of texts and Jinja2 templates. What a file leaves out is taken from English.

Templates are rendered in Jinja2's sandbox: they see values, no objects of ours, and cannot reach anything else
(jinja.palletsprojects.com/en/stable/sandbox). All of a file is compiled when the configuration is read.
"""

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from twin.vocabulary.faults import faults_of, report

ENGLISH = "en"
FILE_BYTES_MAX = 200_000
SUFFIX = ".toml"


class Form(BaseModel):
    """The form of numbers, moments and durations. moment: as in strftime"""

    model_config = ConfigDict(extra="forbid", frozen=True)

    decimal: str = Field(min_length=1, max_length=1)
    moment: str = Field(min_length=1, max_length=60)
    seconds: str
    minutes: str
    hours: str
    days: str


class Texts(BaseModel):
    """The texts of one kind of alert. name: without figures; what: with figures; why: more of it; advice: what to do first"""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(min_length=1, max_length=200)
    what: str = ""
    why: str = ""
    advice: str = ""


class Language(BaseModel):
    """See the module, and `en.toml`, which says what each text is."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    text: str
    over: str
    other: str
    details: str
    link: str
    test: str
    heartbeat: str
    held_back: str
    asked_by: str
    for_lasting: str
    form: Form
    severities: dict[str, str]
    alerts: dict[str, Texts]
    signals: dict[str, str] = {}
    sides: dict[str, str] = {}
    regimes: dict[str, str] = {}
    units: dict[str, str] = {}
    reasons: dict[str, str] = {}


@lru_cache
def shipped() -> tuple[str, ...]:
    """Return the names of the languages that come with the program.

    >>> shipped()
    ('de', 'en')
    """
    names = (entry.name for entry in files(__package__).iterdir())
    return tuple(sorted(name.removesuffix(SUFFIX) for name in names if name.endswith(SUFFIX)))


@lru_cache
def language(name: str) -> Language:
    """Return the language of that name. Raises ValueError for a name that is not shipped."""
    if name not in shipped():
        raise ValueError(f"language {name!r} is not there; write {', '.join(shipped())}, or the path of a {SUFFIX} file")
    return _read((files(__package__) / f"{name}{SUFFIX}").read_text(encoding="utf-8"))


def language_in(path: Path) -> Language:
    """Return the language that a file holds. Raises ValueError naming the file and what is wrong in it."""
    try:
        with path.open("rb") as file:
            content = file.read(FILE_BYTES_MAX + 1)
        if len(content) > FILE_BYTES_MAX:
            raise ValueError(f"the file is larger than {FILE_BYTES_MAX} bytes")
        return _read(content.decode("utf-8"))
    except OSError as error:
        raise ValueError(f"language {path}: {error.strerror or error}; give a readable TOML file") from error
    except ValidationError as error:
        faults = [dict(fault) for fault in error.errors(include_input=False, include_url=False)]
        raise ValueError(report(f"language {path}", faults_of(faults, Language, shown=None))) from error
    except ValueError as error:
        raise ValueError(f"language {path}: {error}") from error


def _read(text: str) -> Language:
    own: dict[str, Any] = tomllib.loads(text)
    english = tomllib.loads((files(__package__) / f"{ENGLISH}{SUFFIX}").read_text(encoding="utf-8"))
    for name in own.get("alerts", {}):
        if name not in english["alerts"] and (near := get_close_matches(name, english["alerts"], 1, 0.85)):
            raise ValueError(f"alerts.{name} is no alert; did you mean {near[0]}?")
    return Language.model_validate(_over(english, own))


def _over(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return two nested tables as one, in which the values of `above` stand over those of `below`."""
    merged = dict(below)
    for name, value in above.items():
        known = below.get(name)
        merged[name] = _over(known, value) if isinstance(value, dict) and isinstance(known, dict) else value
    return merged
