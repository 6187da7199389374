"""Groups of drawn facts: those of known cases, in which some are others of the cases, or near to them.

No rig is played, so thousands are judged in a second; and what no rig comes to, its limits too, is among them.
"""

import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any, Final, TypeAlias

from syncrelay.config import Tolerance
from syncrelay.explain import (
    CauseLog,
    Distribution,
    FindingLog,
    GroupFacts,
    GroupFigures,
    GroupReport,
    InputFacts,
    InputFigures,
    Judge,
    RecentDrop,
    Share,
    with_ok,
)
from syncrelay.explain.epochs import Reading
from syncrelay.explain.summary import summarize
from syncrelay.explain.troubles import troubles
from syncrelay.status.as_document import group_of
from syncrelay.sync.messages import DropReason
from tests.bank.dials import Dial
from tests.explain.support import cases_flow, cases_graph, cases_stamps, cases_transforms
from tests.explain.support.groups import BEGAN, MS, S

Pool: TypeAlias = dict[tuple[type, str], list[Any]]

_CASES: Final = [
    facts
    for module in (cases_graph, cases_stamps, cases_flow, cases_transforms)
    for facts in (*module.FOUND.values(), *(each for cases in module.QUIETLY.values() for each in cases.values()))
]
# What is a time lies near those of the cases, what is a duration does not.
_TIME: Final = BEGAN // 2
_ROUND: Final = (
    0,
    1,
    MS,
    5 * MS,
    20 * MS,
    100 * MS,
    *(n * S // 2 for n in (1, 2, 3, 4, 6, 10, 16, 20, 30, 40, 60, 120)),
)
_COUNTS: Final = (0, 1, 2, 3, 4, 5, 9, 10, 11, 19, 20, 50, 94, 95, 99, 100)
_LOOKS: Final = 6
_MOST: Final = 6
_CHANGES: Final = 0.3
_BACK: Final = 0.3
_DEEPER: Final = 0.8
# As long as another, and what is no more than a few: the index of an input.
_AS_LONG: Final = frozenset({"missing", "sets_since_without", "spans", "latencies"})
_AS_IN_CASES: Final = frozenset({"trigger", "pacemaker", "unsteady", "every", "name", "required", "input"})
# What files may ask for, and no case has.
_MORE: Final[Pool] = {
    (GroupFacts, "every"): [2, 5],
    (GroupFacts, "least_period"): [S, 100 * MS],
    (InputFacts, "narrowed"): [Tolerance("tolerance", 4 * MS), Tolerance("tolerance", 30 * MS)],
    (InputFacts, "own_tolerance"): [Tolerance("max_age", 50 * MS), Tolerance("max_age", S)],
    (InputFacts, "in_quorum"): [True],
    (InputFacts, "required"): [True, False],
    (InputFigures, "resolution"): [10 * MS, S],
    (InputFigures, "reading"): [Reading("run twice as fast", 2.0), Reading("hold microseconds", is_unit=True)],
}


def any_facts(chance: random.Random) -> Iterator[list[GroupFacts]]:
    """Yield what is known of some groups, look by look."""
    base = chance.choice(_CASES)
    groups = [replace(_some_changed(base, chance), name=f"g{n}") for n in range(chance.choice([1, 1, 2, 3, _MOST]))]
    for _ in range(_LOOKS):
        yield [replace(each, figures=replace(each.figures, shares=_same_share(each))) for each in groups]
        by = chance.choice([S, S, 2 * S, 5 * S, 10 * S, 30 * S, 60 * S])
        step: Callable[[GroupFacts, int], Any] = chance.choice([_waits, _goes_on, _goes_on, _goes_on])
        groups = [_some_changed(each, chance) if chance.random() < _CHANGES else each for each in groups]
        groups = [step(each, by) for each in groups]


def _same_share(facts: GroupFacts) -> Callable[[int], Share]:
    return lambda _since: facts.figures.share


def said_of(chance: random.Random) -> Iterator[tuple[str, str]]:
    """Yield all that is said of such groups, with the codes of findings."""
    judges, logs, causes = [Judge() for _ in range(_MOST)], [FindingLog() for _ in range(_MOST)], CauseLog()
    for groups in any_facts(chance):
        found = [judge.judge(facts) for judge, facts in zip(judges, groups, strict=False)]
        now = max(facts.figures.now for facts in groups)
        causes.watch([facts.name for facts in groups])
        for judge, log, facts, each in zip(judges, logs, groups, found, strict=False):
            causes.hear(facts, each, [*log.remarks(facts, each, judge.explained(facts))], now=now)
            yield from ((one.code.value, str(one)) for one in with_ok(facts, each))
            last = [RecentDrop(index, now, chance.choice(list(DropReason))) for index in range(len(facts.inputs))]
            yield "", str(group_of(GroupReport(facts, each, last, log)).as_dict())
            counts = [(one.name, one.counts) for one in facts.inputs]
            yield "", "; ".join(summarize(facts.name, facts.figures.sets, counts, facts.fates))
        yield from (("", line.text) for line in causes.lines(now=now))
        yield from (("", str(each)) for each in troubles([*zip(groups, found, strict=True)], causes.published_by))


def dial_of_facts(chance: random.Random) -> Dial | None:
    """Return what is said of a group by one of the numbers that are known of it."""
    facts = _some_changed(chance.choice(_CASES), chance)
    before = chance.choice([None, facts, _some_changed(facts, chance)])
    facts = _goes_on(facts, chance.choice([0, S, 5 * S, 20 * S]))
    if (dial := _dial(facts, chance)) is None:
        return None
    looks = [] if before is None else [before]
    return dial._replace(said=lambda number: _all_said([*looks, dial.said(number)]))


def dial_of_looks(chance: random.Random) -> Dial:
    """Return what is said of a group look by look, by how much later some looks are."""
    facts = _some_changed(chance.choice(_CASES), chance)
    looks = [facts]
    for _ in range(chance.randint(1, _LOOKS)):
        step: Callable[[GroupFacts, int], Any] = chance.choice([_waits, _goes_on, _goes_on])
        changed = _some_changed(looks[-1], chance) if chance.random() < _CHANGES else looks[-1]
        if chance.random() < _BACK:
            changed = _goes_on(facts, changed.figures.now - facts.figures.now)
        looks.append(step(changed, chance.choice([S, S, 2 * S, 5 * S, 10 * S, 30 * S])))
    first, later = chance.randrange(len(looks)), chance.choice([_waits, _goes_on])

    def said(by: int) -> str:
        moved = [later(each, by) if place == first else _goes_on(each, by) for place, each in enumerate(looks[first:])]
        return _all_said([*looks[:first], *moved])

    return Dial(later.__name__.removeprefix("_"), said, 0, chance.choice([5, 20, 70, 700]) * S)


def _all_said(looks: Iterable[GroupFacts]) -> str:
    """Return all that is said of a group at the last look, and logged at any."""
    judge, log, causes, said, logged = Judge(), FindingLog(), CauseLog(), list[str](), list[str]()
    for facts in looks:
        causes.watch([facts.name])
        found, now = judge.judge(facts), facts.figures.now
        remarks = [*log.remarks(facts, found, judge.explained(facts))]
        causes.hear(facts, found, remarks, now=now)
        said = [f"<{one.code.value}> {one}" for one in with_ok(facts, found)]
        logged += [*map(str, remarks), *(line.text for line in causes.lines(now=now))]
    return "\n".join([*said, *logged, *(f"{each.lasted} {each.text}" for each in log.spells)])


def _dial(value: Any, chance: random.Random) -> Dial | None:
    """Return a record by one of the numbers in it, that number, and another; None of what has none.

    Of many, some or all are moved together.
    """
    parts = [(name, part) for name, part in _parts(value) if name not in _AS_IN_CASES and _has_numbers(part)]
    records = [each for each in parts if not isinstance(each[1], int | float | Distribution)]
    if not parts:
        return None
    name, part = chance.choice(records if records and chance.random() < _DEEPER else parts)

    def put(new: Any) -> Any:
        return _with(value, name, new)

    by = chance.choice([-1, 1]) * chance.choice(_ROUND)
    match part:
        case int() | float():
            return Dial(name, put, part, _number_near(part, chance))
        case Distribution():
            kept = part.newest(len(part))[::-1]
            return Dial(name, lambda more: put(Distribution([each + more for each in kept])), 0, by)
        case [int(), *_] if not hasattr(part, "_fields"):
            at = chance.randrange(len(part))
            among = chance.choice([range(len(part)), range(at, len(part)), [at]])
            moved = [place in among and isinstance(each, int) for place, each in enumerate(part)]
            return Dial(
                name,
                lambda more: put(
                    tuple(each + more if is_of else each for each, is_of in zip(part, moved, strict=True))
                ),
                0,
                by,
            )
        case [_, *_] if not hasattr(part, "_fields"):
            at = chance.randrange(len(part))
            inner, put_inner = _dial(part[at], chance), lambda new: put((*part[:at], new, *part[at + 1 :]))
        case _:
            inner, put_inner = _dial(part, chance), put
    return inner and Dial(f"{name}.{inner.what}", lambda number: put_inner(inner.said(number)), inner.low, inner.high)


def _has_numbers(value: Any) -> bool:
    if isinstance(value, tuple | list) and not hasattr(value, "_fields"):
        return bool(value) and (isinstance(value[0], int) or _has_numbers(value[0]))
    return isinstance(value, int | float | Distribution) is not isinstance(value, bool) or any(
        _has_numbers(each) for _, each in _parts(value)
    )


def _parts(value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a record, none of other values."""
    if is_dataclass(value):
        yield from ((each.name, getattr(value, each.name)) for each in fields(value) if each.repr)
    elif hasattr(value, "_fields"):
        yield from zip(value._fields, value, strict=True)


def _with(value: Any, name: str, part: Any) -> Any:
    return value._replace(**{name: part}) if hasattr(value, "_replace") else replace(value, **{name: part})


def _collect(value: Any, pool: Pool) -> Pool:
    """Note which values each field has."""
    for name, part in _parts(value):
        seen = pool.setdefault((type(value), name), [*_MORE.get((type(value), name), ())])
        if part not in seen:
            seen.append(part)
        for each in part if isinstance(part, tuple) and not hasattr(part, "_fields") else [part]:
            _collect(each, pool)
    return pool


def _some_changed(facts: GroupFacts, chance: random.Random) -> GroupFacts:
    for _ in range(chance.randint(0, 4)):
        facts = _changed(facts, chance)
    if not any(each.required for each in facts.inputs):
        facts = replace(facts, inputs=(replace(facts.inputs[0], required=True), *facts.inputs[1:]))
    # Those of a case with more inputs.
    return replace(facts, lapses=tuple(each for each in facts.lapses if each.input < len(facts.inputs)))


def _changed(value: Any, chance: random.Random) -> Any:
    """Return a record with one of its values, or of those in it, another."""
    name, part = chance.choice([*_parts(value)])
    if isinstance(part, tuple) and not hasattr(part, "_fields") and part and [*_parts(part[0])]:
        at = chance.randrange(len(part))
        return _with(value, name, (*part[:at], _changed(part[at], chance), *part[at + 1 :]))
    if [*_parts(part)] and (isinstance(part, GroupFigures) or chance.random() < 0.9):
        return _with(value, name, _changed(part, chance))
    is_near = name in _AS_LONG or (name not in _AS_IN_CASES and chance.random() < 0.5)
    other = _near(part, chance, is_as_long=name in _AS_LONG) if is_near else chance.choice(_POOL[type(value), name])
    return _with(value, name, other)


def _near(value: Any, chance: random.Random, *, is_as_long: bool = False) -> Any:
    """Return another value near one: of many, each near to its own, or fewer of them."""
    match value:
        case Distribution():
            kept = value.newest(len(value) if is_as_long else chance.choice(_COUNTS))
            two = chance.choices(_ROUND, k=2)
            of_two = chance.random() < 0.5
            return Distribution([chance.choice(two) if of_two else _number_near(each, chance) for each in kept])
        case dict():
            return {key: _number_near(each, chance) for key, each in value.items()}
        case tuple() | list() if not hasattr(value, "_fields"):
            if is_as_long or chance.random() < 0.5:
                return tuple(_number_near(each, chance) for each in value)
            return value[: chance.randrange(len(value) + 1)]
    return _number_near(value, chance)


def _number_near(value: Any, chance: random.Random) -> Any:
    match value:
        case bool():
            return not value
        case int() if value > _TIME:
            return value + chance.choice([-1, 0, 1]) + chance.choice([-1, 1]) * chance.choice(_ROUND)
        case int():
            return chance.choice([-value, 2 * value, value // 2, value + 1, value - 1, *_ROUND, *_COUNTS])
        case float():
            return value * chance.choice([0, 0.05, 0.25, 0.5, 0.7, 0.8, 0.85, 0.95, 1.05, 2, 4])
    return value


def _waits(facts: GroupFacts, by: int) -> GroupFacts:
    """Let time pass in which nothing comes."""
    return replace(facts, figures=replace(facts.figures, now=facts.figures.now + by))


def _goes_on(value: Any, by: int) -> Any:
    """Let time pass in which all goes on as it did."""
    if isinstance(value, int):
        return value + by if value > _TIME else value
    if parts := [*_parts(value)]:
        moved = {name: new for name, part in parts if (new := _goes_on(part, by)) is not part}
        if not moved:
            return value
        return value._replace(**moved) if hasattr(value, "_replace") else replace(value, **moved)
    if isinstance(value, tuple | list) and value and (not isinstance(value[0], int) or value[0] > _TIME):
        return type(value)(_goes_on(each, by) for each in value)
    return value


_POOL: Final[Pool] = {}
for _each in _CASES:
    _collect(_each, _POOL)
