"""Reading XML of limited size, without entities."""

from xml.etree import ElementTree

MAX_DEPTH = 64
"""Levels of tags of an XML document."""

MAX_MARKS = 200_000
"""Tags and attributes of a document, counted as its `<` and `=`: half a second of parsing."""

MAX_ATTRIBUTES, MAX_VALUE = 100, 10_000
"""Attributes of a tag, and characters of one of them."""


class _StrictBuilder(ElementTree.TreeBuilder):
    """Builds the tree; refuses a DOCTYPE, and with it every entity, and absurd tags."""

    depth = 0

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Refuse a DOCTYPE."""
        if name.lower() == "html":
            raise ValueError("is an HTML page")
        raise ValueError("has a DOCTYPE: entities are not expanded, remove it")

    def start(self, tag: str, attrs: dict[str, str], /) -> ElementTree.Element:
        """Open an element."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ValueError(f"nests tags deeper than {MAX_DEPTH}")
        if len(attrs) > MAX_ATTRIBUTES or any(len(v) > MAX_VALUE for v in attrs.values()):
            raise ValueError(
                f"has a tag <{tag[:40]}> with more than {MAX_ATTRIBUTES} attributes, or one of "
                f"more than {MAX_VALUE} characters"
            )
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ElementTree.Element:
        """Close an element."""
        self.depth -= 1
        return super().end(tag)


def parse_xml(text: str) -> ElementTree.Element:
    """Return the root of an XML document of limited size; raise `ValueError` with the reason."""
    if not text.strip():
        raise ValueError("is empty")
    marks = text.count("<") + text.count("=")
    if marks > MAX_MARKS:
        raise ValueError(f"has {marks} tags and attributes: at most {MAX_MARKS} are read")
    try:
        parser = ElementTree.XMLParser(target=_StrictBuilder(), encoding="utf-8")
        return ElementTree.fromstring(text.encode(), parser=parser)
    except ElementTree.ParseError as error:
        raise ValueError(f"is not well-formed XML ({error})") from None
    except LookupError as error:  # an encoding declared but unknown
        raise ValueError(f"cannot be parsed ({error})") from None
