"""Writes the pages: `python -m docs.generate`."""

from docs.generate import FOLDER, pages

for name, text in pages().items():
    (FOLDER / name).write_text(text)
