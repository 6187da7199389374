"""What single keys can't tell: a restamp that names no input, a set that would wait without end."""

from collections.abc import Iterator, Sequence

from syncrelay.config.bundle import BundleKeys
from syncrelay.config.document import Document, MappingNode, ScalarNode, SequenceNode
from syncrelay.config.installed import installed_policies
from syncrelay.config.keys import MOST
from syncrelay.config.models import Distance
from syncrelay.config.names import LONGEST_TOPIC
from syncrelay.config.problems import Problem, Severity
from syncrelay.config.resolved import GroupConfig
from syncrelay.config.sections import NodeConfig
from syncrelay.config.units import MAX_NS, NS_PER_UNIT
from syncrelay.config.wording import all_of, one_of, or_nearest, quoted

# Beside a message per waiting tick: the one held for the previous tick, and the one for the next.
_HELD_BESIDE = 2
# Every node has this service below its name; it is the longest of them.
_LONGEST_NODE = LONGEST_TOPIC - len("/set_parameters_atomically")
# Longer durations are refused as out of range.
_LONGEST_S = MAX_NS // NS_PER_UNIT["s"]
_RESTAMP_WORDS = ("none", "earliest", "latest", "trigger")


def check_groups(groups: Sequence[GroupConfig], document: Document) -> Iterator[Problem]:
    """Yield conflicts between the keys of each group. Names and types are checked elsewhere."""
    node = document.find(("groups",))
    if isinstance(node, MappingNode) and not node.entries:
        yield document.problem(("groups",), "expected one group or more, found none", code="too_few")
    for group in groups:
        yield from _too_few(group, document)
        yield from _other_policy(group, document)
        yield from _restamp(group, document)
        yield from _trigger(group, document)
        yield from _clock(group, document)
        yield from _bundle(group, document)
        yield from _device_clocks(group, document)
        yield from _times_of_arrival(group, document)
        yield from _keys(group, document)
        yield from _optional_inputs(group, document)
        yield from _quorum(group, document)
        yield from _tolerances(group, document)
        yield from _unit(group, document)
        yield from _unwritten_types(group, document)


def check_node(node: NodeConfig, document: Document) -> Iterator[Problem]:
    """Yield a node name that is too long with its namespace."""
    name = node.absolute("~")
    if len(name) > _LONGEST_NODE:
        path = ("node", "namespace") if document.has(("node", "namespace")) else ("node", "name")
        text = (
            f"the node's full name has {len(name)} characters, at most {_LONGEST_NODE} are allowed: it becomes part of"
            " the names of its services"
        )
        yield document.problem(path, text, code="bad_value")


def _too_few(group: GroupConfig, document: Document) -> Iterator[Problem]:
    path = (*group.path, "topics")
    topics = document.find(path)
    if isinstance(topics, SequenceNode) and len(topics.items) < 2:  # noqa: PLR2004  one has nothing to match
        text = f"expected 2 topics or more, found {'one' if topics.items else 'none'}"
        yield document.problem(path, text, code="too_few", span=document.key_span(path))


def _other_policy(group: GroupConfig, document: Document) -> Iterator[Problem]:
    """Yield a policy that a package offers too, and does not get to replace."""
    other = installed_policies().refused.get(group.options.policy or "")
    if other is not None:
        yield document.problem((*group.path, "policy"), other, code="policy", severity=Severity.WARNING)


def _restamp(group: GroupConfig, document: Document) -> Iterator[Problem]:
    restamp, path = group.options.restamp, (*group.path, "restamp")
    if restamp == "trigger" and group.restamp is None and group.options.trigger_key is None:
        text = f"{group.options.policy} has no trigger: expected none, earliest, latest or an input of this group"
        yield document.problem(path, text, code="bad_value")
    elif restamp not in _RESTAMP_WORDS and group.restamp is None:
        below = [name for name in _inputs(group) if name.startswith(f"{restamp}/")]
        likely = below[0] if len(below) == 1 else document.nearest(restamp, (*_RESTAMP_WORDS, *_inputs(group)))
        text = f"expected none, earliest, latest or an input of this group, found {quoted(restamp)}{or_nearest(likely)}"
        yield document.problem(path, text, code="bad_value")


def _unwritten_types(group: GroupConfig, document: Document) -> Iterator[Problem]:
    """Yield one note for all topics without a type in the file."""
    open_ones = [
        (path, topic.topic)
        for path, topic in group.paths()
        if topic.type is None and topic.topic and (*path, "type") not in document.faulty
    ]
    if open_ones:
        names = all_of(dict.fromkeys(quoted(name) for _, name in open_ones))
        whose = f"the type of {names} comes" if len(open_ones) == 1 else f"the types of {names} come"
        text = f"{whose} from the graph when the relay runs, or from the recording, and cannot be checked here"
        path, _ = open_ones[0]
        yield document.problem((*path, "topic"), text, code="type_from_graph", severity=Severity.NOTE)


def _trigger(group: GroupConfig, document: Document) -> Iterator[Problem]:
    named, key = group.options.trigger_topic, group.options.trigger_key
    if named is None or key is None:
        return
    path = (*group.path, key)
    at = None if group.trigger is None else (*group.path, "topics", group.trigger, "max_age")
    if at is not None and document.has(at):
        text = f"{quoted(named)} triggers every set, so its messages have no age: `max_age` belongs to the others"
        yield document.problem(at, text, code="conflict")
    if group.trigger is None:
        hint = document.did_you_mean(named, _inputs(group))
        yield document.problem(path, f"{quoted(named)} is not an input of this group{hint}", code="bad_value")
    elif not group.topics[group.trigger].required:
        text = f"{quoted(named)} triggers every set, so it cannot be optional (`required: false`)"
        yield document.problem(path, text, code="conflict")


def _clock(group: GroupConfig, document: Document) -> Iterator[Problem]:
    """Yield a queue that overflows while sets wait: it holds one message for each tick, and the latest before them."""
    ticks, max_wait, size = group.ticks, group.options.max_wait, group.options.queue_size
    trigger = (*group.path, group.options.trigger_key or "")
    queue, wait = ((*group.path, key) for key in ("queue_size", "max_wait"))
    if ticks is None or max_wait is None or {trigger, queue, wait} & document.faulty:
        return
    needed = -(-max_wait // ticks.period_ns) + _HELD_BESIDE
    if needed > size:
        text = (
            f"queue_size {document.filled_in(queue) or size} is too short for this max_wait at"
            f" {document.filled_in(trigger) or ticks}: up to {needed} messages of an input wait for"
            f" their ticks, write {'`queue_size: ' + str(needed) + '`' if needed <= MOST else 'a shorter max_wait'}"
        )
        yield document.problem(queue if document.has(queue) else wait, text, code="conflict")


def _bundle(group: GroupConfig, document: Document) -> Iterator[Problem]:
    """Yield sets that nothing leaves of, and inputs that a bundle cannot be told to hold."""
    bundle, outputs = ((*group.path, key) for key in ("bundle", "outputs"))
    if {bundle, outputs} & document.faulty:
        return
    if not group.options.outputs:
        if group.bundle is None:
            yield document.problem(outputs, "no set would leave: write a `bundle`, or remove this", code="conflict")
        for output in ((*path, "output") for path, _ in group.paths() if document.has((*path, "output"))):
            text = "this topic has no output of its own, as `outputs` is false: remove one of them"
            yield document.problem(output, text, code="conflict")
    if group.options.bundle is not None:
        yield from _fields(group.options.bundle, group, document)
        for path, topic in group.paths():
            if topic.type is None and topic.topic and (*path, "type") not in document.faulty:
                text = "write its `type` too: the fields of the `bundle` are found by it"
                yield document.problem((*path, "topic"), text, code="missing")


def _fields(bundle: BundleKeys, group: GroupConfig, document: Document) -> Iterator[Problem]:
    """Yield fields for what is no input, and a second field for an input."""
    fields, names = (*group.path, "bundle", "fields"), group.inputs.names
    seen: dict[str, str] = {}
    for field, topic in bundle.fields.items():
        name = group.inputs.node.absolute(topic)
        if name not in names:
            text = f"{quoted(topic)} is not an input of this group{document.did_you_mean(name, names)}"
            yield document.problem((*fields, field), text, code="no_such_input")
        elif seen.setdefault(name, field) != field:
            text = f"{quoted(topic)} is in `{seen[name]}` already: an input has one field"
            yield document.problem((*fields, field), text, code="conflict")


def _times_of_arrival(group: GroupConfig, document: Document) -> Iterator[Problem]:
    """Yield an input matched by its time of arrival, or by a stamp mapped by it, where stamps must be equal.

    They never are, to the nanosecond.
    """
    tolerance = group.options.tolerance
    received = [
        ((*path, "stamp"), "a time of arrival") if topic.stamp == "receive" else ((*path, "clock"), "a mapped stamp")
        for path, topic in group.paths()
        if topic.stamp == "receive" or topic.is_of_device
    ]
    if not received or tolerance is None or tolerance.takes_times_of_arrival:
        return
    path, what = received[0]
    needed_by, instead = f"`{tolerance.key}: 0`", f"a larger `{tolerance.key}`, such as 20ms"
    if tolerance.wider_policy is not None:
        needed_by, instead = group.options.policy, f"`policy: {tolerance.wider_policy}` with a `{tolerance.key}`"
    text = f"{what} never equals another stamp, as {needed_by} needs it: write {instead}, or use a stamp of the message"
    yield document.problem(path, text, code="conflict")


def _device_clocks(group: GroupConfig, document: Document) -> Iterator[Problem]:
    """Yield inputs whose stamps are to be mapped and are none, and delays that nothing takes off."""
    for path, topic in group.paths():
        at_clock, at_delay = (*path, "clock"), (*path, "delay")
        if topic.is_of_device and topic.stamp == "receive":
            text = "`stamp: receive` is of this machine's time already: leave out one of the two"
            yield document.problem(at_clock, text, code="conflict")
        elif topic.is_of_device and group.inputs.node.use_sim_time:
            text = "stamps cannot be mapped to simulated time, which `use_sim_time` goes by: leave out one of the two"
            yield document.problem(at_clock, text, code="conflict")
        elif topic.delay_ns and not topic.is_of_device and at_clock not in document.faulty:
            text = "a delay is taken off with `clock: device` only: write that too, or an `offset`"
            yield document.problem(at_delay, text, code="conflict")


def _inputs(group: GroupConfig) -> list[str]:
    return [name for name, topic in zip(group.inputs.names, group.topics, strict=True) if topic.topic]


def _keys(group: GroupConfig, document: Document) -> Iterator[Problem]:
    if group.options.by_stamp or (*group.path, "key") in document.faulty:
        return
    for topic, config in group.paths():
        path = (*topic, "key")
        if config.key is None and path not in document.faulty:
            text = (
                f"missing, {group.options.policy} needs the field to match by, here or in the group:"
                " `key: header.frame_id`"
            )
            yield document.problem(path, text, code="missing")


def _optional_inputs(group: GroupConfig, document: Document) -> Iterator[Problem]:
    optional = [path for path, topic in group.paths() if not topic.required]
    has_quorum = group.options.quorum is not None or (*group.path, "quorum") in document.faulty
    if optional and len(optional) == len(group.topics) and not has_quorum:
        path = (*group.path, "topics")
        text = (
            "all inputs of this group are optional, at least one must be required, or say with `quorum` how many a set"
            " needs"
        )
        yield document.problem(path, text, code="conflict", span=document.key_span(path))
    is_endless = group.options.max_wait is None and (*group.path, "max_wait") not in document.faulty
    if optional and group.options.waits_for_optional and is_endless:
        what, whom = ("a quorum", "the others") if has_quorum else ("an optional input", "it")
        text = f"{what} needs the group's `max_wait`: how long a set waits for {whom}, for example 100ms"
        path = (*group.path, "quorum") if has_quorum else (*optional[0], "required")
        yield document.problem(path, text, code="missing")


def _quorum(group: GroupConfig, document: Document) -> Iterator[Problem]:
    quorum, n_inputs, required = group.options.quorum, len(group.topics), len(group.required)
    if quorum is None:
        return
    path = (*group.path, "quorum")
    if quorum >= n_inputs:
        text = (
            f"the group has {n_inputs} inputs, all of which a set needs without `quorum`: write less, or leave it out"
        )
        yield document.problem(path, text, code="bad_value")
    elif required >= quorum:
        those = "1 input is" if required == 1 else f"{required} inputs are"
        text = f"{those} required already, so that `quorum: {quorum}` changes nothing: write more, or leave it out"
        yield document.problem(path, text, code="conflict")
    elif not required and not group.options.takes_any:
        able = one_of(sorted(name for name, model in installed_policies().models.items() if model.takes_any))
        text = (
            f"{group.options.policy} makes sets round the inputs that are required: write `required: true` at one, or"
            f" use {able}"
        )
        yield document.problem(path, text, code="conflict")
    elif not required and group.options.tolerance is None and group.options.distance is Distance.SPAN:
        text = "a quorum without a required input needs a `slop`: without one any messages belong together"
        yield document.problem(path, text, code="conflict")


def _tolerances(group: GroupConfig, document: Document) -> Iterator[Problem]:
    slop = group.options.tolerance
    for (topic, _), own in zip(group.paths(), group.narrowed, strict=True):
        if own is not None and slop is not None and 2 * own.ns >= slop.ns:
            text = "no less than half the `slop`, so it changes nothing: write less, or a wider slop, or leave it out"
            yield document.problem((*topic, "tolerance"), text, code="conflict", severity=Severity.WARNING)


def _unit(group: GroupConfig, document: Document) -> Iterator[Problem]:
    """Warn of a slop of 1 or more without a unit: it means seconds, but people usually mean milliseconds."""
    tolerance = group.options.tolerance
    if tolerance is None or group.options.distance is not Distance.SPAN:
        return
    path = (*group.path, tolerance.key)
    node = document.find(path)
    span = node.value if isinstance(node, ScalarNode) else None
    if isinstance(span, int | float) and not isinstance(span, bool) and 1 <= span <= _LONGEST_S:
        number = f"{span:.15g}"
        text = (
            f"{number} without a unit means {number} s: write {number}ms if you mean milliseconds, otherwise {number}s"
        )
        if filled_in := document.filled_in(path):
            text = f"a number without a unit means seconds, give {filled_in} a unit: ms or s"
        yield document.problem(path, text, code="unit", severity=Severity.WARNING)
