"""Colours the drawings of policies, and names the languages that pages use and Pygments does not know."""  # noqa: INP001

from typing import Any

from pygments.lexer import RegexLexer, bygroups
from pygments.lexers.special import TextLexer
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text
from sphinx.application import Sphinx


class Timeline(RegexLexer):
    """A drawing as `tests/sync/support/timeline.py` reads it: a policy, lanes of messages, what leaves when."""

    name = "Timeline"
    aliases = ["timeline"]  # noqa: RUF012  as Pygments has it
    tokens = {  # noqa: RUF012
        "root": [
            (r"^(\S+)( *)(\|)", bygroups(Name.Tag, Text, Operator), "lane"),
            (r"^(->)( )([^:\n]+)(:)", bygroups(Operator, Text, Number, Punctuation), "leaves"),
            (r"^(keys)(:)(.*)$", bygroups(Keyword, Punctuation, Text)),
            (r"^\w+(?=,|$)", Keyword),
            (r"[\w]+(?=:)", Name.Attribute),
            (r"[^\n]", Text),
            (r"\n", Text),
        ],
        "lane": [(r"\.+", Comment), (r"[^.\n]", String), (r"\n", Text, "#pop")],
        "leaves": [
            (r"\b[a-z_]{3,}\b", Comment),
            (r"\w+", String),
            (r"[^\w\n]", Text),
            (r"\n", Text, "#pop"),
        ],
    }


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_lexer("timeline", Timeline)
    app.add_lexer("mermaid", TextLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
