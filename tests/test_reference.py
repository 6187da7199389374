"""The pages of docs/reference that are made of what the program knows say what it knows now."""

import re
from itertools import pairwise

import pytest

from docs.generate import FOLDER, pages

_PAGES = pages()


@pytest.mark.parametrize("page", _PAGES)
def test_a_page_of_the_reference_says_what_the_program_knows(page):
    assert (FOLDER / page).read_text() == _PAGES[page], "run `make reference`"


@pytest.mark.parametrize("page", _PAGES)
def test_a_page_of_the_reference_leaves_nothing_without_its_meaning(page):
    lines = _PAGES[page].splitlines()
    assert [line for line in lines if re.search(r"`: *$|\|  \||^None$", line)] == []
    assert [one for one, after in pairwise(filter(None, lines)) if one.startswith("### ") and after[:2] == "##"] == []
