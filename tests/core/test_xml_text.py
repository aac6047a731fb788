import pytest

from kickdyn.core.xml_text import parse_xml


def test_text_and_attributes_are_read():
    root = parse_xml("<?xml version='1.0'?><!-- note --><a b='1'><c>text</c></a>")
    assert (root.tag, root.attrib, root.findtext("c")) == ("a", {"b": "1"}, "text")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (" ", "is empty"),
        ("<a>", "is not well-formed XML"),
        ("<!DOCTYPE html><html/>", "is an HTML page"),
        ("<!DOCTYPE a><a/>", "has a DOCTYPE: entities are not expanded, remove it"),
        ("<a>" * 65 + "</a>" * 65, "nests tags deeper than 64"),
    ],
)
def test_what_is_refused(text, reason):
    with pytest.raises(ValueError, match=reason):
        parse_xml(text)
