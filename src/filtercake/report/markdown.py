"""Pages of the documentation as HTML that needs nothing else: formulas as MathML, links within the project as text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from latex2mathml.converter import convert
from markdown_it import MarkdownIt
from markdown_it.token import Token
from mdit_py_plugins.dollarmath import dollarmath_plugin


def to_html(text: str) -> str:
    """Convert CommonMark with tables, and LaTeX between dollars, to the body of an HTML page; HTML becomes text."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    parser.use(dollarmath_plugin, renderer=_formula)
    tokens = parser.parse(text)
    for token in tokens:
        _unlink(token.children or [])
    html: str = parser.renderer.render(tokens, parser.options, {})
    return html


def _formula(latex: str, options: dict[str, Any]) -> str:
    return convert(latex, display="block" if options["display_mode"] else "inline")


def _unlink(tokens: Sequence[Token]) -> None:
    """Replace links to other files of the project by text: a report has no such files beside it."""
    local = False
    for token in tokens:
        if token.type == "link_open":
            target = str(token.attrs.get("href", ""))
            local = "://" not in target
            if local:
                token.tag, token.attrs = "cite", {"title": target}
        elif token.type == "link_close" and local:
            token.tag, local = "cite", False
