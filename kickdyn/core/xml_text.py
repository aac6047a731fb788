"""Reading XML without entities."""

from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException, DTDForbidden
from defusedxml.ElementTree import fromstring

MAX_DEPTH = 64
"""Levels of tags of an XML document: parsers of robots' files call themselves at each level."""


def parse_xml(text: str) -> Element:
    """Return the root of an XML document; raise `ValueError` with the reason.

    A document type, with which entities come, is refused. Whatever encoding the document declares,
    it is taken as the text that it is.
    """
    if not text.strip():
        raise ValueError("is empty")
    try:
        root: Element = fromstring(text, forbid_dtd=True)
    except DTDForbidden as error:
        if error.name.lower() == "html":
            raise ValueError("is an HTML page") from None
        raise ValueError("has a DOCTYPE: entities are not expanded, remove it") from None
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise ValueError(f"is not well-formed XML ({error})") from None
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
        if depth > MAX_DEPTH:
            raise ValueError(f"nests tags deeper than {MAX_DEPTH}")
    return root
