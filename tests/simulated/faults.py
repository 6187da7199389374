"""What may happen in a world: how it begins and ends, and what is true meanwhile.

A new kind is a function here. It is called when it begins, and returns what ends it, or None.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

from syncrelay.config.profile import Profile
from tests.simulated.plan import TYPE, Group, Plan
from tests.simulated.scheduler import MS, SECOND, Process
from tests.simulated.world import OTHER_TYPE, Driver, World

_HOUR: Final = 3600 * SECOND
End: TypeAlias = Callable[[], object] | None
_Begin: TypeAlias = Callable[[World, str, float], End]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of event, and what is true while it lasts."""

    begin: _Begin
    needs: tuple[str, ...]
    """`sensor` or `group` where it is about one; `sim`, `real`, `played`, `managed`, `several`, `transforms` where the
    world must be so; `brief` where it is over at once; `start` where it begins with the world."""
    names: frozenset[str]
    """The first finding of the groups that it concerns is one of these, if any; `starting` and `healthy` go without."""
    must: bool
    """Whether there must be one, where nothing makes up for it."""
    spoils: bool
    """Whether sets may be missing meanwhile."""
    again_s: float = 15.0
    """How long after its end they may be missing."""
    at_end: bool = False
    """Whether none may be missing before its end."""


KINDS: Final[dict[str, Kind]] = {}


def _kind(
    *needs: str,
    names: str = "",
    must: bool = False,
    spoils: bool = True,
    again_s: float = 15.0,
    at_end: bool = False,
) -> Callable[[_Begin], _Begin]:
    def add(begin: _Begin) -> _Begin:
        name = begin.__name__
        KINDS[name] = Kind(begin, needs, frozenset(names.split()), must, spoils, again_s, at_end)
        return begin

    return add


def needs() -> Mapping[str, tuple[str, ...]]:
    """Return what each kind is about, as `plan.draw` takes it."""
    return {name: kind.needs for name, kind in KINDS.items()}


def concerns(kind: str, target: str, group: Group) -> bool:
    """Whether an event concerns a group."""
    needed = KINDS[kind].needs
    if kind == "refuse_subscriptions":
        # Other groups share its topics.
        return True
    if "sensor" in needed:
        return target in group.topics
    return target == group.name if "group" in needed else True


def is_felt(kind: str, target: str, group: Group, plan: Plan) -> bool:
    """Whether the group must say so: where an input is optional, a message serves again, or others are left, it may."""
    if not KINDS[kind].must or target in group.optional:
        return False
    if kind == "unstamped" and "key" in group.options:
        return False
    if kind == "other_clock" and plan.by_sim_time:
        # What took a step ahead is told late, by stamps alone, where few messages come.
        return False
    sensor = next((each for each in plan.sensors if each.topic == target), None)
    if kind in ("halves", "other_clock", "twice"):
        return sensor is not None and sensor.every == 1 and not group.repeats and "key" not in group.options
    return True


def _set(world: World, target: str, **changes: object) -> Callable[[], None]:
    """Change a driver; what is returned makes it a usual one again, whatever else was changed meanwhile."""
    driver = world.drivers[target]
    usual = driver.usual

    def put(values: Mapping[str, object]) -> None:
        for key in changes:
            setattr(driver, key, values[key])

    put(changes)
    return partial(put, usual)


def _returning(world: World, target: str, **changes: object) -> Callable[[], None]:
    """Have a driver end and return at once as another; what is returned has it return as it was."""
    driver = world.drivers[target]

    def exchange(driver: Driver, change: Callable[[], object]) -> None:
        driver.leave()
        change()
        world.scheduler.after(200 * MS, driver.start)

    back: list[Callable[[], None]] = []
    exchange(driver, lambda: back.append(_set(world, target, **changes)))
    return lambda: exchange(driver, back[0])


def _change(world: World, group: str) -> None:
    world.changed[group] = world.changed.get(group, 0) + 1
    world.write_file()
    world.reload()


@_kind("sensor", names="silent slowed", must=True)
def silent(world: World, target: str, _: float) -> End:
    """The publisher is there, and sends nothing."""
    return _set(world, target, is_silent=True)


@_kind("transforms", names="no_transform", must=True)
def transforms_stop(world: World, _: str, __: float) -> End:
    """Nobody publishes where the robot is."""
    world.broadcaster.is_silent = True

    def go_on() -> None:
        world.broadcaster.is_silent = False

    return go_on


@_kind("sensor", names="no_publisher alone", must=True)
def leaves(world: World, target: str, _: float) -> End:
    """The driver ends in order."""
    world.drivers[target].leave()
    return world.drivers[target].start


@_kind("sensor", names="no_publisher silent slowed", must=True)
def dies(world: World, target: str, _: float) -> End:
    """The driver is killed."""
    world.drivers[target].die()
    return world.drivers[target].start


@_kind("sensor", names="no_publisher silent slowed", must=True)
def dies_in_write(world: World, target: str, _: float) -> End:
    """The driver is killed in the midst of a message."""
    world.drivers[target].dies_in_write = True

    def back() -> None:
        world.drivers[target].dies_in_write = False
        world.drivers[target].die()
        world.drivers[target].start()

    return back


@_kind("sensor", "brief", names="no_publisher silent")
def restarts(world: World, target: str, _: float) -> End:
    """The driver ends and comes back at once."""
    _returning(world, target)
    return None


@_kind("sensor", names="slowed silent few_sets", must=True)
def halves(world: World, target: str, _: float) -> End:
    """Every second message is not sent."""
    return _set(world, target, is_halved=True)


@_kind("sensor", names="unstamped", must=True)
def unstamped(world: World, target: str, _: float) -> End:
    """Stamps are 0."""
    return _set(world, target, is_zero=True)


@_kind("sensor", names="malformed", must=True)
def malformed(world: World, target: str, _: float) -> End:
    """Messages are cut off."""
    return _set(world, target, is_cut=True)


@_kind("sensor", names="other_clock clock_step time_jump", must=True)
def other_clock(world: World, target: str, _: float) -> End:
    """Stamps are an hour off; no time is before 0."""
    return _set(world, target, shift=_HOUR if world.plan.by_sim_time else -_HOUR)


@_kind("sensor", names="duplicates several_publishers", must=True, spoils=False)
def twice(world: World, target: str, _: float) -> End:
    """Every message comes twice."""
    return _set(world, target, is_twice=True)


@_kind(
    "sensor", names="over_slop constant_offset clock_step few_sets silent slowed clock_drift out_of_order short_queue"
)
def stamps_early(world: World, target: str, _: float) -> End:
    """Stamps are too early, by more than sets may span."""
    return _set(world, target, shift=-80 * MS)


# Delays that grow and fall with each batch, or as what was lost is sent again, look like a drift where few messages
# make one: its clock is to be modelled.
@_kind("sensor", names="bursts short_queue silent slowed waiting_for_optional few_sets out_of_order clock_drift")
def batches(world: World, target: str, _: float) -> End:
    """Messages are held back, and sent together."""
    return _set(world, target, batch=1500 * MS)


@_kind("sensor", names="other_type several_types no_publisher alone", must=True)
def other_type(world: World, target: str, _: float) -> End:
    """The driver comes back with messages of another type."""
    return _returning(world, target, type=OTHER_TYPE)


@_kind("sensor", names="no_publisher silent")
def best_effort(world: World, target: str, _: float) -> End:
    """The driver comes back with another reliability, which the relay follows."""
    return _returning(world, target, reliability="best_effort")


@_kind("sensor", names="several_publishers duplicates out_of_order clock_step time_jump", spoils=True, must=True)
def second_publisher(world: World, target: str, _: float) -> End:
    """Another node publishes on the topic, of another clock."""
    driver = Driver(world, world.drivers[target].sensor, world.drivers[target].index)
    driver.shift = -3 * SECOND
    driver.start()
    return driver.leave


# Transforms are messages, too: what is lost of them is sent again, later than sets wait.
@_kind(names="messages_lost slowed silent bursts short_queue clock_drift no_transform")
def loss(world: World, _: str, __: float) -> End:
    """The network loses a third of all messages."""
    weather = world.bus.weather
    weather.loss = 0.3

    def end() -> None:
        weather.loss = 0.0

    return end


@_kind(names="too_slow messages_lost short_queue few_sets silent bursts slowed")
def stall(world: World, _: str, seconds: float) -> End:
    """The relay's process gets no processor."""
    if world.relay is not None:
        world.relay.process.stall(round(min(seconds, 8.0) * SECOND))
    return None


@_kind("real", "brief", names="clock_step")
def clock_set(world: World, _: str, __: float) -> End:
    """This machine's clock is set."""
    by = world.random.choice([-3600, -90, -2, 3, 3600]) * SECOND
    # Two that set it against each other do so by turns.
    for number in range(world.random.choice([1, 1, 3])):
        world.scheduler.after(number * 2500 * MS, partial(world.set_clock, -by if number % 2 else by))
    return None


@_kind(names="paused", must=True)
def pause(world: World, _: str, __: float) -> End:
    """~/pause, and ~/resume in the end; perhaps a group is exchanged meanwhile."""
    world.ask("pause")
    if world.random.random() < 0.4:
        world.scheduler.after(SECOND, partial(_change, world, world.random.choice(world.plan.groups).name))
    return partial(world.ask, "resume")


@_kind(names="refused_by_dds", must=True)
def refuse_messages(world: World, _: str, __: float) -> End:
    """DDS takes no message from the relay."""

    def refuse(why: str | None) -> None:
        node = world.relay.node if world.relay is not None else None
        for publisher in node.publishers if node is not None else ():
            publisher.refusal = why

    refuse("out of samples")
    return partial(refuse, None)


@_kind(names="output_taken", must=True, spoils=False)
def output_taken(world: World, _: str, __: float) -> End:
    """Another node publishes on the outputs."""
    participant = world.bus.participant(Process(world.scheduler, "rival"))
    node = participant.node("rival")
    for topic in world.outputs:
        node.writer(topic, TYPE, Profile())
    return participant.leave


@_kind(spoils=False)
def newcomers(world: World, _: str, __: float) -> End:
    """Nodes that have nothing to do with the relay come and go."""
    participant = world.bus.participant(Process(world.scheduler, "newcomer"))
    node = participant.node("newcomer", "/elsewhere")
    node.writer("/elsewhere/odd", OTHER_TYPE, Profile())
    node.reader("/elsewhere/even", TYPE, Profile())
    return participant.leave


@_kind(spoils=False)
def services(world: World, _: str, __: float) -> End:
    """Somebody asks how it stands, again and again."""
    for name in ("status", "status", "status"):
        world.ask(name)
    return partial(world.ask, "status")


@_kind("brief", spoils=False)
def reload_same(world: World, _: str, __: float) -> End:
    """The file is read again, and says the same."""
    world.reload()
    return None


@_kind(spoils=False)
def reload_faulty(world: World, _: str, __: float) -> End:
    """The file is not valid for a while; or it is written in parts."""
    whole = world.file()
    world.write_file(whole[: int(len(whole) * world.random.random())])
    world.reload()

    def mend() -> None:
        world.write_file()
        world.reload()

    return mend


@_kind("group", "brief", names="no_publisher silent")
def reload_changed(world: World, target: str, _: float) -> End:
    """A group is exchanged for one of other values."""
    _change(world, target)
    return None


@_kind("group", "several")
def reload_without(world: World, target: str, _: float) -> End:
    """A group is taken from the file, and put back."""
    if len(world.absent) == len(world.plan.groups) - 1:
        return None
    world.absent.add(target)
    world.write_file()
    world.reload()

    def back() -> None:
        world.absent.discard(target)
        world.write_file()
        world.reload()

    return back


@_kind("group", names="refused_by_dds", at_end=True)
def reload_refused(world: World, target: str, _: float) -> End:
    """DDS makes nothing on the outputs, while a group is exchanged."""
    world.refusal = "no memory"
    _change(world, target)

    def back() -> None:
        world.refusal = None
        world.reload()

    return back


@_kind(names="nobody_listens")
def nobody_listens(world: World, _: str, __: float) -> End:
    """Who listens to all outputs leaves."""
    world.witness.leave()
    return world.witness.start


@_kind("managed", names="inactive", must=True)
def deactivate(world: World, _: str, __: float) -> End:
    """The managed node is deactivated, and activated again."""
    world.is_to_be_active = False
    world.transit("deactivate")
    return world.bring_up


@_kind("managed", names="inactive")
def configure_again(world: World, _: str, __: float) -> End:
    """The managed node is taken back to its first state, by somebody who also asks for what is not possible."""
    world.is_to_be_active = False
    for name in ("configure", "deactivate", "activate", "deactivate", "cleanup"):
        world.transit(name)
    return world.bring_up


@_kind("sim", names="clock_stopped no_clock silent time_jump", must=True)
def clock_stops(world: World, _: str, __: float) -> End:
    """The simulation stands still, and goes on where it was."""
    world.stop_rig_clock()
    ends = [_set(world, topic, is_silent=True) for topic in world.drivers]

    def go_on() -> None:
        world.go_on_with_rig_clock()
        for end in ends:
            end()

    return go_on


@_kind("sim", "brief", names="time_jump clock_step")
def clock_loops(world: World, _: str, __: float) -> End:
    """The simulation begins again."""
    world.shift_rig_clock(-world.stamp_at(world.scheduler.now))
    return None


@_kind("real", "played", "brief", names="time_jump clock_step", again_s=0.0)
def loops(world: World, _: str, __: float) -> End:
    """All sensors begin again, as a recording that is played in a loop."""
    world.shift_rig_clock(-world.random.choice([20, 600]) * SECOND)
    return None


@_kind("sensor", names="slowed bursts over_slop")
def doubles(world: World, target: str, _: float) -> End:
    """The driver sends every message again, half a period later."""
    return _set(world, target, is_doubled=True)


@_kind(names="few_sets", spoils=False)
def namesake(world: World, _: str, __: float) -> End:
    """Another node has the relay's name."""
    participant = world.bus.participant(Process(world.scheduler, "namesake"))
    participant.node("syncrelay").reader("/elsewhere/odd", OTHER_TYPE, Profile())
    return participant.leave


@_kind("group", names="refused_by_dds incompatible_qos no_publisher silent bursts")
def refuse_subscriptions(world: World, target: str, _: float) -> End:
    """DDS makes nothing more, on any topic, and the group's sensors come back with another reliability."""
    world.refused_everywhere = "no memory"
    group = next(each for each in world.plan.groups if each.name == target)
    topic = group.topics[0]
    other = "best_effort" if world.drivers[topic].reliability == "reliable" else "reliable"
    end = _returning(world, topic, reliability=other)

    def relent() -> None:
        world.refused_everywhere = None
        world.reload_again()
        end()

    return relent


@_kind("brief", spoils=False)
def file_in_parts(world: World, _: str, __: float) -> End:
    """The file is written anew in two parts; who watches it waits until it rests."""
    whole = world.file()
    world.write_file(whole[: len(whole) // 2])
    world.scheduler.after(SECOND, world.write_file)
    return None


@_kind(spoils=False)
def file_gone(world: World, _: str, __: float) -> End:
    """The file is not there for a while."""
    world.path.unlink(missing_ok=True)
    world.reload()

    def back() -> None:
        world.write_file()
        world.reload()

    return back


@_kind("brief", spoils=False)
def reload_often(world: World, _: str, __: float) -> End:
    """Somebody sends SIGHUP and calls ~/reload at once, many times."""
    for after in range(12):
        world.scheduler.after(after * 20 * MS, world.reload)
    return None


@_kind("start", names="refused_by_dds")
def refuse_output(world: World, _: str, __: float) -> End:
    """From the start on DDS makes nothing on one of the outputs."""
    world.refused_output = world.random.choice(list(world.outputs))

    def relent() -> None:
        world.refused_output = None
        world.reload_again()

    return relent


@_kind("sensor", names="no_publisher alone silent slowed", must=True)
def returns_silent(world: World, target: str, seconds: float) -> End:
    """The driver ends, and comes back with nothing to send."""
    driver = world.drivers[target]
    driver.leave()
    end = _set(world, target, is_silent=True)
    world.scheduler.after(round(seconds / 4 * SECOND), driver.start)
    return end
