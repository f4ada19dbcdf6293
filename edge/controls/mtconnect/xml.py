"""XML from an agent that is not trusted: no document types, no entities, bounded size and depth.

MTConnect needs neither DTDs nor entities, so any `<!DOCTYPE` is refused before its contents are read: what entity bombs and
external entities need is never there. Element names are compared without their namespace, because agents from 1.2 to 2.x differ
in nothing else.
"""

import re
from functools import lru_cache
from typing import Any
from xml.etree import ElementTree as ET

from edge.errors import DocumentError

DOCUMENT_BYTES_MAX = 64 * 1024 * 1024
SMALL_BYTES_MAX = 64 * 1024
DEPTH_MAX = 64
ELEMENTS_MAX = 200_000
ATTRIBUTES_MAX = 100  # of one element
_NAMESPACE = re.compile(r"\{urn:mtconnect\.org:MTConnect(\w+):(\d+(?:\.\d+)*)\}")


class _Builder(ET.TreeBuilder):
    """The usual tree, but no document type, no bottomless nesting and no flood of elements."""

    _depth = 0
    _elements = 0

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise DocumentError(f"document type {name!r} refused: an MTConnect document has none")

    def start(self, tag: Any, attrs: Any, /) -> Any:
        self._depth += 1
        if self._depth > DEPTH_MAX:
            raise DocumentError(f"elements nested deeper than {DEPTH_MAX}")
        self._elements += 1
        if self._elements > ELEMENTS_MAX:
            raise DocumentError(f"document of more than {ELEMENTS_MAX} elements")
        if len(attrs) > ATTRIBUTES_MAX:
            raise DocumentError(f"element {tag:.80} has {len(attrs)} attributes; the most that is read is {ATTRIBUTES_MAX}")
        return super().start(tag, attrs)

    def end(self, tag: Any, /) -> Any:
        self._depth -= 1
        return super().end(tag)


def parse_xml(raw: bytes) -> ET.Element:
    """The root element, or DocumentError."""
    if len(raw) > DOCUMENT_BYTES_MAX:
        raise DocumentError(f"document of {len(raw)} bytes; the most that is read is {DOCUMENT_BYTES_MAX}")
    parser = ET.XMLParser(target=_Builder())  # noqa: S314  document types are refused by the builder
    try:
        parser.feed(raw)
        root = parser.close()
    except (ET.ParseError, ValueError, LookupError) as error:  # LookupError: an encoding that Python does not know
        raise DocumentError(f"no well-formed XML: {error}") from error
    assert isinstance(root, ET.Element)
    return root


def parse_small(raw: bytes) -> ET.Element | None:
    """The root element of a small document, by the C parser alone, which is three times as fast; None where it has to be careful.

    Without `<!` there is no document type. That holds for all encodings but those with zero bytes: an encoding that expat takes
    reads ASCII as ASCII. The nesting is not bounded, so the caller may not descend as far as a document goes.
    """
    if len(raw) > SMALL_BYTES_MAX or b"<!" in raw or b"\0" in raw:
        return None
    try:
        return ET.fromstring(raw)  # noqa: S314
    except (ET.ParseError, ValueError, LookupError):
        return None


@lru_cache(maxsize=4096)
def local_tag(tag: str) -> str:
    """Return a tag without its namespace."""
    return tag.rpartition("}")[2]


def local_name(element: ET.Element) -> str:
    """The name without its namespace."""
    return local_tag(element.tag)


def schema_version(root: ET.Element) -> str:
    """The schema version that the namespace states, "" where it states none.

    >>> schema_version(parse_xml(b'<a xmlns="urn:mtconnect.org:MTConnectStreams:1.4"/>'))
    '1.4'
    """
    found = _NAMESPACE.match(root.tag)
    return found.group(2) if found else ""
