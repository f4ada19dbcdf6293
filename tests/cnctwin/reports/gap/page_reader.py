"""A strict reader of the report: it raises where an element is not closed, closed twice, or in a place where it may not be."""

from html.parser import HTMLParser

VOID = {"br", "col", "meta"}
RAW = {"script", "style"}
ONLY_IN = {
    "tr": {"thead", "tbody"},
    "td": {"tr"},
    "th": {"tr"},
    "thead": {"table"},
    "tbody": {"table"},
    "caption": {"table"},
    "li": {"ul"},
    "dt": {"dl", "div"},
    "dd": {"dl", "div"},
    "figcaption": {"figure"},
    "summary": {"details"},
}
PHRASES = {"p", "h1", "h2", "h3", "span", "b", "code", "strong", "summary", "button"}
BLOCKS = {"p", "div", "table", "ul", "dl", "section", "article", "figure", "h1", "h2", "h3", "pre", "details"}


class PageReader(HTMLParser):
    """What a page consists of: elements with their attributes, and the text that is seen."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.scripts: list[str] = []
        assert page.startswith("<!doctype html>\n")
        self.feed(page)
        self.close()
        assert not self.open, f"not closed: {self.open}"
        names = [attributes["id"] for _, attributes in self.elements if "id" in attributes]
        assert len(names) == len(set(names)), f"an id is there twice: {names}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"<{tag}> has an attribute twice: {names}"
        parent = self.open[-1] if self.open else ""
        assert tag not in ONLY_IN or parent in ONLY_IN[tag], f"<{tag}> in <{parent}>"
        assert not (parent in PHRASES and tag in BLOCKS), f"<{tag}> in <{parent}>"
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-1:]}"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in RAW:
            self.scripts.append(data)
        else:
            self.texts.append(data)

    @property
    def text(self) -> str:
        """All that is seen, blanks as one."""
        return " ".join(" ".join(self.texts).split())

    def of(self, tag: str, **attributes: str) -> list[dict[str, str | None]]:
        """The elements of a name that have these attributes; a class among others counts."""
        return [
            given
            for name, given in self.elements
            if name == tag
            and all(
                value in (given.get("class") or "").split() if key == "class_" else given.get(key.replace("_", "-")) == value
                for key, value in attributes.items()
            )
        ]
