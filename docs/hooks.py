"""For mkdocs: what the site needs beside its extensions, which bring scripts from other hosts.

Formulas become MathML, which browsers draw themselves. A link that leaves docs/ is plain text on the site. The word behind the
language of a code block (```sh background), which is for the tests, is left out: mkdocs would take the block for text.
"""

import posixpath
import re
from html import unescape
from typing import Any

from latex2mathml.converter import convert

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(((?!https?:|mailto:|#)[^)#\s]+)(#[^)\s]*)?\)")
MARKED = re.compile(r"^(```\w+) \w+$", re.MULTILINE)
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Called with the text of each page."""
    folder = posixpath.dirname(page.file.src_uri)

    def inside(link: re.Match[str]) -> str:
        outside = posixpath.normpath(posixpath.join(folder, link[2])).startswith("..")
        return link[1] if outside else link[0]

    return LINK.sub(inside, MARKED.sub(r"\1", markdown))


def on_page_content(html: str, **_: Any) -> str:
    """Called with each page in HTML: formulas of method.md become MathML."""
    return FORMULA.sub(lambda found: convert(unescape(found[2]), display="block" if found[1] == "div" else "inline"), html)
