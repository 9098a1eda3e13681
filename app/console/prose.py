"""The Markdown of a protocol's texts as HTML: headings, lists and emphasis, and nothing that acts.

HTML in a text stays text. Links are words with their address behind them: a page that leads out of
the study would strand the participant. Pictures are their words.
"""

from collections.abc import Iterable, Sequence
from functools import cache

from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

_RULES = ("heading", "list", "emphasis", "link", "image", "newline", "escape")
_DEEPEST = 4  # of headings; the page has the first level itself


def prose(paragraphs: Iterable[str]) -> Markup:
    """The paragraphs, each of which may hold several blocks, as HTML."""
    markdown = _markdown()
    blocks: list[Token] = markdown.parse("\n\n".join(paragraphs))
    for block in blocks:
        if block.type in ("heading_open", "heading_close"):
            block.tag = f"h{min(int(block.tag[1:]) + 1, _DEEPEST)}"
        block.children = _only_words(block.children or ())
    return Markup(markdown.renderer.render(blocks, markdown.options, {}))


@cache
def _markdown() -> MarkdownIt:
    """Only these rules: raw HTML, code, tables and whatever else there is stay as they are typed."""
    return MarkdownIt("zero", {"html": False}).enable([*_RULES])


def _only_words(tokens: Sequence[Token]) -> list[Token]:
    """Inline tokens with links and pictures as words."""
    words: list[Token] = []
    addresses: list[str] = []
    for token in tokens:
        if token.type == "link_open":
            addresses.append(str(token.attrGet("href")).removeprefix("mailto:"))
        elif token.type == "link_close":
            address = addresses.pop()
            if words and words[-1].content != address:
                words.append(_text(f" ({address})"))
        elif token.type == "image":
            words.append(_text(token.content))
        else:
            words.append(token)
    return words


def _text(content: str) -> Token:
    return Token("text", "", 0, content=content)
