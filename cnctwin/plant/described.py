"""The findings of `cnctwin doctor` on descriptions: which is live since when, what is assumed, what waits, what is wrong."""

import shlex
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from cnctwin.plant.descriptions import Known, LiveDescriptions
from cnctwin.plant.finding import Finding
from processors.description import Role
from twin.assumed import listed
from twin.live.assumed import completed
from twin.machine import MachineFile

LIVE_SECTIONS = ("thermal", "spindle")
"""Sections that live figures rest on: where a file has none, the built-in one is assumed."""


@dataclass(frozen=True, slots=True)
class DescribedMachine:
    """A machine by its description. Versions are "" where there is none; times are ms since 1970.

    assumed: sections and constants that nobody has stated or fitted, by path; None = nobody has described the machine
    faults: what is wrong with its files, or keeps a processor from taking them up
    """

    machine: str
    version: str = ""
    since_ms: int = 0
    step: str = ""
    by: str = ""
    why: str = ""
    assumed: tuple[str, ...] | None = None
    challenger: str = ""
    challenger_since_ms: int = 0
    challenger_why: str = ""
    faults: tuple[str, ...] = ()


def described_machines(descriptions: LiveDescriptions, machines: Collection[str]) -> tuple[DescribedMachine, ...]:
    """Return the machines that are connected or described, in alphabetical order."""
    live, waiting, faults = descriptions.known(Role.LIVE), descriptions.known(Role.CHALLENGER), descriptions.faults()
    names = sorted({*machines, *live, *waiting, *(machine for machine, _ in faults)})
    return tuple(
        _described(name, live.get(name), waiting.get(name), tuple(fault.text for of, fault in faults if of == name))
        for name in names
    )


def _described(machine: str, live: Known | None, waits: Known | None, faults: tuple[str, ...]) -> DescribedMachine:
    found = DescribedMachine(machine, faults=faults)
    if live is not None:
        told = live.message
        found = DescribedMachine(
            machine, told.version, told.t, told.step, told.by, told.why, assumptions(live.description.machine), faults=faults
        )
    if waits is None:
        return found
    return replace(found, challenger=waits.message.version, challenger_since_ms=waits.message.t, challenger_why=waits.message.why)


def assumptions(machine: MachineFile) -> tuple[str, ...]:
    """Return what of a machine is assumed: what its file says, and the sections of live figures that it lacks.

    >>> from twin.machine import Machine
    >>> assumptions(MachineFile(machine=Machine(name="vmc", assumed=("tool",))))
    ('tool', 'thermal', 'spindle')
    """
    for section in LIVE_SECTIONS:
        machine = completed(machine, section)
    return machine.machine.assumed


def sentences(found: DescribedMachine, store: str = "STORE") -> Iterator[Finding]:
    """Return a finding on each thing there is to say of a machine's description."""
    name = found.machine
    typed = shlex.quote(name)
    fit = f"`cnctwin identify --store {shlex.quote(store)} --machine {typed} --out {shlex.quote(f'{name}.toml')}` fits"
    if found.assumed is None:
        text = f"{name}: not described, so its constants are assumed; write machines/{name}.toml, or {fit} one"
        yield Finding(True, text, note=True)
    else:
        how = " ".join(filter(None, (found.step, f"by {found.by}" if found.by else "")))
        said = ": ".join(filter(None, (how, found.why)))
        yield Finding(True, f"{name}: description {found.version} is live{_since(found.since_ms)}{f', {said}' if said else ''}")
        if found.assumed:
            verb, them = ("is", "it") if len(found.assumed) == 1 else ("are", "them")
            yield Finding(True, f"{name}: {listed(found.assumed)} {verb} assumed; {fit} {them}", note=True)
    if found.challenger:
        why = f": {found.challenger_why}" if found.challenger_why else ""
        waits = f"challenger {found.challenger} waits{_since(found.challenger_since_ms)}{why}"
        way = f"`cnctwin twin show {typed}` weighs it, `cnctwin twin promote {typed}` makes it live"
        yield Finding(True, f"{name}: {waits}; {way}", note=True)
    for fault in found.faults:
        yield Finding(False, f"{name}: {fault}")


def _since(at_ms: int) -> str:
    return f" since {datetime.fromtimestamp(at_ms / 1000, UTC):%Y-%m-%d %H:%M} UTC" if at_ms else ""
