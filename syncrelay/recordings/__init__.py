"""Recordings are read, analysed, replayed, tested, and written as datasets. The relay never imports this package."""
