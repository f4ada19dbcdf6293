"""Roles and rights: what each role may ask for. A reader looks, an operator runs the shift, an administrator changes the twin."""

import re
from enum import IntEnum
from typing import NamedTuple

from cnctwin.api.i3x.problem import PREFIX as I3X

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})


class Role(IntEnum):
    """A role may do all that a lower one may."""

    READER = 1
    OPERATOR = 2
    ADMINISTRATOR = 3

    @property
    def title(self) -> str:
        """The word for it in configuration, answers and messages."""
        return self.name.lower()


class Right(NamedTuple):
    """The right that a request needs: the least role, and the action as the record has it; empty where nothing changes."""

    role: Role
    action: str
    object: str = ""


_TABLE = tuple(
    (method, re.compile(pattern), role, action)
    for method, pattern, role, action in (
        ("POST", "/predict", Role.READER, ""),
        ("POST", "/twin/replay", Role.READER, ""),
        ("POST", f"{I3X}/(objecttypes/query|relationshiptypes/query|objects/(list|related|value|history))", Role.READER, ""),
        ("POST", f"{I3X}/subscriptions(/(list|delete|register|unregister|sync|stream))?", Role.READER, ""),
        ("PUT", f"{I3X}/objects/(value|history)", Role.READER, ""),  # refused: nothing is written
        ("POST", "/login", Role.READER, "log in"),
        ("POST", "/logout", Role.READER, "log out"),
        ("POST", "/alerts/([^/]+)/acknowledge", Role.OPERATOR, "acknowledge"),
        ("POST", "/silences", Role.OPERATOR, "silence"),
        ("POST", "/silences/([^/]+)/end", Role.OPERATOR, "end silence"),
        ("POST", "/jobs", Role.OPERATOR, "ask for job"),
        ("POST", "/jobs/([^/]+)/cancel", Role.OPERATOR, "cancel job"),
        ("POST", "/models/([^/]+/[^/]+)/promote", Role.ADMINISTRATOR, "promote model"),
        ("POST", "/twin/([^/]+)/diagnose", Role.OPERATOR, "diagnose"),
        ("POST", "/twin/([^/]+)/promote", Role.OPERATOR, "promote twin"),
        ("POST", "/twin/([^/]+)/back", Role.OPERATOR, "go back"),
        ("POST", "/twin/([^/]+)/withdraw", Role.OPERATOR, "withdraw challenger"),
        ("POST", "/anomaly/([^/]+)/verdict", Role.OPERATOR, "give verdict"),
        ("POST", "/demo/reveal", Role.OPERATOR, "reveal"),
        ("GET", "/audit", Role.ADMINISTRATOR, ""),
    )
)


def right_of(method: str, path: str) -> Right:
    """Return what a request takes. Whatever may change something and is not in the table takes an administrator.

    >>> right_of("POST", "/jobs/night-7/cancel")
    Right(role=<Role.OPERATOR: 2>, action='cancel job', object='night-7')
    >>> right_of("GET", "/machines").role, right_of("DELETE", "/machines").role
    (<Role.READER: 1>, <Role.ADMINISTRATOR: 3>)
    """
    for known, pattern, role, action in _TABLE:
        if known == method and (found := pattern.fullmatch(path)):
            return Right(role, action, found[1] if pattern.groups else "")
    return Right(Role.READER, "") if method in SAFE_METHODS else Right(Role.ADMINISTRATOR, method.lower()[:20], path)


def stated_rights() -> frozenset[tuple[str, str]]:
    """Return method and pattern of each entry of the table."""
    return frozenset((method, pattern.pattern) for method, pattern, _, _ in _TABLE)
