"""Of any facts, the rules that are not asked would find nothing."""

import random
import sys

from syncrelay.explain import Judge, judge
from tests.bank.any_facts import any_facts
from tests.faults.extent import chosen


def test_a_rule_that_is_not_asked_finds_nothing(monkeypatch):
    for seed in range(chosen(short=40, long=3000)):
        for facts in (each for groups in any_facts(random.Random(f"asked {seed}")) for each in groups):
            found = judge(facts)
            with monkeypatch.context() as patch:
                all_asked = lambda rules, facts: (each for rule in rules for each in rule.findings(facts))  # noqa: E731
                patch.setattr(sys.modules[Judge.__module__], "found_by", all_asked)
                assert judge(facts) == found
