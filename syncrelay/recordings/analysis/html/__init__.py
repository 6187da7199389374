"""An analysis as one HTML file that needs nothing else: no network, no other file."""

from syncrelay.recordings.analysis.html.document import as_html
from syncrelay.recordings.pages import MARK

__all__ = ["MARK", "as_html"]
