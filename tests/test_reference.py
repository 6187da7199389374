"""The generated pages of docs/reference are up to date."""

import re
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

import docs.generate
from docs.generate import FOLDER
from syncrelay.explain import Code

_TEMPLATES = Path(docs.generate.__file__).parent / "templates"
_NAMES = sorted(path.stem for path in _TEMPLATES.glob("*.jinja"))
# Made once, by the first test that asks.
pages = cache(docs.generate.pages)


def test_each_template_is_a_page():
    assert sorted(pages()) == _NAMES


@pytest.mark.parametrize("page", _NAMES)
def test_a_page_of_the_reference_says_what_the_program_knows(page):
    assert (FOLDER / page).read_text() == pages()[page], "run `make reference`"


@pytest.mark.parametrize("page", _NAMES)
def test_a_page_of_the_reference_leaves_nothing_without_its_meaning(page):
    lines = pages()[page].splitlines()
    assert [line for line in lines if re.search(r"`: *$|\|  \||^None$", line)] == []
    assert [one for one, after in pairwise(filter(None, lines)) if one.startswith("### ") and after[:2] == "##"] == []


def test_the_page_of_findings_says_of_each_what_it_means_and_what_to_do_unless_all_is_well():
    _, *sections = re.split(r"(?m)^## ", pages()["findings.md"])
    parts = {re.match(r"`(\w+)`\n", each)[1]: each.strip().split("\n\n")[1:] for each in sections}  # type: ignore[index]
    assert [*parts] == [code.value for code in Code]
    assert [code for code, (meaning, *_) in parts.items() if not meaning.endswith(".")] == []
    without = [code for code, said in parts.items() if not any(part.startswith("**What to do:** ") for part in said)]
    assert without == ["nobody_listens", "starting", "healthy"]
    assert [code for code, said in parts.items() if not said[-1].startswith("- Severity: ")] == []
