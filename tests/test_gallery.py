"""The gallery shows what the program says and draws today."""

import re

from docs.generate.gallery import PAGE, PICTURES, PROBLEMS, gallery


def test_the_gallery_says_and_draws_what_the_analysis_of_its_rigs_gives():
    text, pictures = gallery()
    assert PAGE.read_text() == text, "run `make reference`"
    assert {each.name: each.read_text() for each in PICTURES.iterdir()} == pictures, "run `make reference`"


def test_each_cure_is_what_a_finding_offers_but_for_the_sensor_that_only_its_owner_can_do_without():
    quotes = dict(zip(PROBLEMS, re.findall(r"^> (.+)$", PAGE.read_text(), re.MULTILINE), strict=True))
    unoffered = {
        problem.name
        for problem, quote in quotes.items()
        if not all(f"`{key}: {value}`" in quote for _, key, value in problem.cure)
    }
    assert unoffered == {"dead_sensor"}
