"""Markdown of a protocol's texts: what it may become, and that nothing else gets through."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import escape

from steerlab.app.console.prose import prose

ALLOWED = {"p", "h2", "h3", "h4", "ul", "ol", "li", "strong", "em", "br"}


def test_headings_lists_and_emphasis():
    text = ("# One", "**bold** and *soft*", "- a\n- b", "1. x\n2. y", "###### six")
    assert prose(text) == (
        "<h2>One</h2>\n<p><strong>bold</strong> and <em>soft</em></p>\n<ul>\n<li>a</li>\n"
        "<li>b</li>\n</ul>\n<ol>\n<li>x</li>\n<li>y</li>\n</ol>\n<h4>six</h4>\n"
    )


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("[a page](https://example.org/x?y=1)", "a page (https://example.org/x?y=1)"),
        ("[us](mailto:lab@example.org)", "us (lab@example.org)"),
        ("[https://example.org](https://example.org)", "https://example.org"),
        ("https://example.org", "https://example.org"),
    ],
)
def test_links_are_words(text, shown):
    assert prose([text]) == f"<p>{shown}</p>\n"


@pytest.mark.parametrize(
    "text",
    [
        "<script>alert(1)</script>",
        "<img src=x onerror=alert(1)>",
        "[click](javascript:alert(1))",
        "[click](<javascript:alert(1)>)",
        "[click](https://x.org \"onmouseover='alert(1)'\")",
        "![picture](https://example.org/p.png)",
        "![picture](javascript:alert(1))",
        "<https://example.org>",
        "[ref]\n\n[ref]: javascript:alert(1)",
        "`code`\n\n    <b>code</b>\n\n```html\n<b>\n```",
        "<!-- -->\n\n&lt;script&gt; &#60;script&#62;",
        "| a | b |\n|---|---|\n| <i>1</i> | 2 |",
    ],
)
def test_nothing_that_acts_gets_through(text):
    html = str(prose([text]))
    assert {tag.lower() for tag in re.findall(r"</?([^\s>/]*)", html)} <= ALLOWED
    assert not re.search(r"<[a-z0-9]+ (?!start=)", html)  # no attribute but a list's first number


@given(st.lists(st.text(max_size=80), max_size=4))
def test_whatever_is_typed_only_known_tags_come_of_it(paragraphs):
    html = str(prose(paragraphs))
    assert {tag for tag in re.findall(r"</?([^\s>/]*)", html)} <= ALLOWED
    assert not re.search(r"<[a-z0-9]+ (?!start=\"\d+\">)", html)


PLAIN = st.text(st.characters(codec="ascii", categories=("L", "Nd", "Zs")), min_size=1).map(
    lambda text: f"Text {' '.join(text.split())}".strip()
)


@given(st.lists(PLAIN, min_size=1, max_size=4))
def test_plain_paragraphs_are_as_they_were(paragraphs):
    assert prose(paragraphs) == "".join(f"<p>{escape(one)}</p>\n" for one in paragraphs)


def test_quotes_and_signs_are_shown_as_they_are_typed():
    text = 'It\'s 2 * 3 & "more" <than> snake_case_words, P001.'
    assert prose([text]) == (
        "<p>It's 2 * 3 &amp; &quot;more&quot; &lt;than&gt; snake_case_words, P001.</p>\n"
    )
