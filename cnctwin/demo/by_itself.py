"""The choice of who goes on with the loop of the demo: a person, or the loop by itself."""

from enum import StrEnum


class ByItself(StrEnum):
    """The one who goes on with the loop: the loop, or a person at the page."""

    BY_ITSELF = "by-itself"
    BY_HAND = "by-hand"
