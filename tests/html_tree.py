"""A page as a tree of elements, for tests to look at."""

from html.parser import HTMLParser

VOID = {"meta", "link", "input"}


class Element:
    """An element of a page: attributes, and in order its texts and inner elements."""

    def __init__(self, tag, attributes):
        self.tag, self.attributes, self.inner = tag, dict(attributes), []

    @property
    def text(self):
        return "".join(part if isinstance(part, str) else part.text for part in self.inner)

    @property
    def words(self):
        return " ".join(self.text.split())

    def all(self, tag, of_class=None):
        for part in self.inner:
            if isinstance(part, Element):
                classes = part.attributes.get("class", "").split()
                if part.tag == tag and (of_class is None or of_class in classes):
                    yield part
                yield from part.all(tag, of_class)


class Parser(HTMLParser):
    """Fails where an element is not closed, or in the wrong order."""

    def __init__(self):
        super().__init__()
        self.open = [Element("", ())]

    def handle_starttag(self, tag, attrs):
        self.open.append(Element(tag, attrs))
        if tag in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        element = self.open.pop()
        assert element.tag == tag, f"</{tag}> closes <{element.tag}>"
        self.open[-1].inner.append(element)

    def handle_data(self, data):
        self.open[-1].inner.append(data)


def parse(html):
    parser = Parser()
    parser.feed(html)
    parser.close()
    assert len(parser.open) == 1, f"never closed: {[e.tag for e in parser.open[1:]]}"
    return parser.open[0]
