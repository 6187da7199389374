"""A fleet's report as one HTML file that needs nothing else: no network, no other file."""

from syncrelay.cli.fleet_html.document import fleet_as_html
from syncrelay.cli.pages import MARK

__all__ = ["MARK", "fleet_as_html"]
