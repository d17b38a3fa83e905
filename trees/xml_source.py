"""XML text to plain elements that know their line; everything dangerous in XML is refused here."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.sax import SAXParseException
from xml.sax.handler import ContentHandler
from xml.sax.xmlreader import AttributesImpl

from defusedxml.common import DefusedXmlException, DTDForbidden
from defusedxml.expatreader import DefusedExpatParser

from bt_tasksim.core.errors import InputError

LARGEST = 2_000_000
"""Bytes that a file may have."""
DEEPEST = 250
"""Levels of elements that a file may have."""


@dataclass
class Element:
    """An XML element.

    Attributes:
        tag: Its name.
        attributes: Its attributes.
        line: Where it begins.
        children: The elements in it.
        text: The text right in it, without white space around.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    text: str = ""


def parse(content: str | bytes, source: str) -> Element:
    """The root element of a document.

    Args:
        content: The document.
        source: Where it comes from, for the error's sentence.

    Raises:
        InputError: It is not well-formed, too large, too deep, or declares a document type or entities.
    """
    size = len(content) if isinstance(content, bytes) else len(content.encode(errors="surrogatepass"))
    if size > LARGEST:
        raise InputError(f"{source}: the file has {size / 1e6:.1f} MB, at most {LARGEST / 1e6:g} MB are read")
    parser = DefusedExpatParser(forbid_dtd=True, forbid_entities=True, forbid_external=True)
    builder = _Builder(source, parser)
    parser.setContentHandler(builder)
    try:
        parser.feed(content)
        parser.close()
    except DefusedXmlException as error:
        what = "a document type (DTD)" if isinstance(error, DTDForbidden) else "an entity"
        raise InputError(
            f"{source}, line {parser.getLineNumber()}: {what} is declared, which is not read"
        ) from None
    except SAXParseException as error:
        raise InputError(
            f"{source}, line {error.getLineNumber()}: malformed XML: {error.getMessage()}"
        ) from None
    except InputError as error:  # it comes from within expat, and this is no place to name
        raise InputError(str(error)) from None
    except (ValueError, LookupError) as error:
        raise InputError(f"{source}: malformed XML: {error}") from None
    if builder.root is None:
        raise InputError(f"{source}: the file is empty")
    return builder.root


class _Builder(ContentHandler):
    def __init__(self, source: str, parser: DefusedExpatParser) -> None:
        super().__init__()
        self.source = source
        self.parser = parser
        self.root: Element | None = None
        self.path: list[Element] = []

    def startElement(self, name: str, attrs: AttributesImpl) -> None:  # noqa: N802
        line = self.parser.getLineNumber() or 0
        element = Element(name, dict(attrs.items()), line)
        if len(self.path) >= DEEPEST:
            raise InputError(f"{self.source}, line {line}: more than {DEEPEST} levels of elements")
        if self.path:
            self.path[-1].children.append(element)
        else:
            self.root = element
        self.path.append(element)

    def endElement(self, name: str) -> None:  # noqa: N802
        element = self.path.pop()
        element.text = element.text.strip()

    def characters(self, content: str) -> None:
        if self.path:
            self.path[-1].text += content
