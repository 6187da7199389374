"""An analysis as one HTML file that needs nothing else: no network, no other file."""

from syncrelay.recordings.analysis.html.document import MARK, as_html

__all__ = ["MARK", "as_html"]
