"""XML in and out: refuse documents that define entities, write elements as text in one namespace."""

import re
from xml.etree import ElementTree

from cnctwin.standins.mtconnect_agent.errors import DeviceModelError

_DECLARATION = re.compile(r"<!(DOCTYPE|ENTITY)", re.IGNORECASE)
_ILLEGAL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_ESCAPED = re.compile('[&<>"\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]')


def parse_xml(text: str) -> ElementTree.Element:
    """Parse, but no document type and no entities: both can be made to read files or to fill the memory."""
    declaration = _DECLARATION.search(text)
    if declaration:
        raise DeviceModelError(f"the XML has a <!{declaration[1]}> declaration; remove it, plain elements are enough")
    try:
        return ElementTree.fromstring(text)  # noqa: S314  entities are refused above
    except ElementTree.ParseError as error:
        raise DeviceModelError(f"not well-formed XML: {error}; begins {text[:60]!r}") from error


def escape(text: str) -> str:
    """Escape for element text and attributes; characters that XML can't carry become U+FFFD.

    >>> escape('a<b & "c"')
    'a&lt;b &amp; &quot;c&quot;'
    """
    if _ESCAPED.search(text) is None:
        return text
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")
    return _ILLEGAL.sub("\ufffd", text)


def attributes(pairs: dict[str, str]) -> str:
    """Write attributes, sorted by name as agent 2.x does.

    >>> attributes({"name": "X", "id": "x1"})
    ' id="x1" name="X"'
    """
    return "".join(f' {name}="{escape(value)}"' for name, value in sorted(pairs.items()))


def local_name(tag: str) -> str:
    """Return the tag without its namespace.

    >>> local_name("{urn:mtconnect.org:MTConnectDevices:1.3}Device")
    'Device'
    """
    return tag.rpartition("}")[2]


def element_text(element: ElementTree.Element, indent: str = "") -> str:
    """Write an element and all below it without namespaces, so that it takes that of the document around it."""
    tag = local_name(element.tag)
    head = f"{indent}<{tag}{attributes({local_name(k): v for k, v in element.attrib.items()})}"
    text = (element.text or "").strip()
    children = [element_text(child, indent + "  ") for child in element if isinstance(child.tag, str)]
    if children:
        return "\n".join((f"{head}>{escape(text)}", *children, f"{indent}</{tag}>"))
    return f"{head}>{escape(text)}</{tag}>" if text else f"{head}/>"
