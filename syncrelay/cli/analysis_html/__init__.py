"""An analysis as one HTML file that needs nothing else: no network, no other file."""

from syncrelay.cli.analysis_html.document import as_html
from syncrelay.cli.pages import MARK

__all__ = ["MARK", "as_html"]
