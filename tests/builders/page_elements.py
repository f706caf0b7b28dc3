"""A page as its reader takes it apart."""

from html.parser import HTMLParser

from recoil_identification.report.page.packing import unpacked


class PageElements(HTMLParser):
    """Every element of a page with its attributes, and the text of its scripts."""

    def __init__(self, page):
        super().__init__()
        self.elements, self.scripts, self.text, self._in = [], {}, "", None
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self._in = (dict(attrs).get("id", "code") if tag == "script" else None) or self._in

    def handle_endtag(self, tag):
        if tag == "script":
            self._in = None

    def handle_data(self, data):
        if self._in is None:
            self.text += data
        else:
            self.scripts[self._in] = self.scripts.get(self._in, "") + data

    def carried(self, name):
        """The report, or the figures, that the page carries for its script."""
        return unpacked(self.scripts["packed"])[name]
