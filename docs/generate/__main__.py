"""Writes the pages: `python -m docs.generate`."""

from docs.generate import FOLDER, pages
from docs.generate.gallery import PAGE, PICTURES, gallery

for name, text in pages().items():
    (FOLDER / name).write_text(text)
shown, pictures = gallery()
PAGE.write_text(shown)
PICTURES.mkdir(exist_ok=True)
for name, picture in pictures.items():
    (PICTURES / name).write_text(picture)
