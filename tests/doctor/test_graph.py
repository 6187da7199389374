"""The graph and its groups, by values."""

from dataclasses import replace

import pytest

from syncrelay.doctor.diagnosis import Severity
from syncrelay.doctor.graph import (
    check_clock,
    check_domains,
    check_graph,
    check_groups,
    check_own_name,
    check_sizes,
    check_state,
)
from syncrelay.explain import Code, Endpoint, GraphSnapshot, GroupReport, judge
from syncrelay.sync.counts import InputCounts
from tests.explain.support.groups import IMAGE, NOW, S, a_group, a_silent_group, an_input

ERROR, WARNING, INFO = Severity.ERROR, Severity.WARNING, Severity.INFO
GRAPH = GraphSnapshot(3, "SUBNET", ("/camera_driver",), 3)


def report(facts):
    return GroupReport(facts, judge(facts))


def unpublished(name, **facts):
    return an_input(name, publishers=(), figures={"last_received": None, "fed": 0}, **facts)


def silent(**facts):
    return an_input(counts=InputCounts(0, 0, {}, 0), figures={"last_received": None, "fed": 0}, **facts)


def brief(diagnoses):
    return [(each.code, each.severity) for each in diagnoses]


def test_alone_is_told_with_the_domain_and_once():
    empty = GraphSnapshot(3, "LOCALHOST")
    (found,) = check_graph(empty)
    assert (found.code, found.severity) == ("alone", ERROR)
    assert found.what == "no other node was found on domain 3 (discovery range LOCALHOST)"
    facts = a_silent_group(unpublished("/camera"), an_input("/lidar"), empty_graph=empty)
    assert "alone" not in {each.code for each in check_groups([report(facts)], [])}
    assert list(check_graph(GRAPH)) == []


def test_nodes_that_are_found_but_do_not_get_through_are_not_taken_for_absent():
    (found,) = check_graph(replace(GRAPH, nodes=(), n_unreached=1))
    assert (found.code, found.severity) == ("unreachable", ERROR)
    assert found.what == "1 topic on domain 3 has a publisher whose node is not known"
    assert "let UDP ports 8150 to 8399 through" in (found.fix or "")
    unreached = Endpoint("a publisher whose node is not known yet", IMAGE, is_named=False)
    facts = a_silent_group(silent(publishers=(unreached,)), an_input("/lidar"))
    assert [each.code for each in judge(facts)] == [Code.SILENT]
    assert list(check_groups([report(facts)], [])) == []


def test_a_managed_node_that_is_not_active_is_told_with_its_next_transition():
    (found,) = check_state("inactive", "/robot/syncrelay")
    assert (found.code, found.severity) == ("inactive", WARNING)
    assert found.what == "/robot/syncrelay: the node is inactive"
    assert found.fix == "activate it with `ros2 lifecycle set /robot/syncrelay activate`"
    (found,) = check_state("unconfigured", "/syncrelay")
    assert found.fix == "configure it with `ros2 lifecycle set /syncrelay configure`"
    assert "restart" in (next(check_state("finalized", "/syncrelay")).fix or "")
    assert [*check_state("active", "/syncrelay"), *check_state("activating", "/s"), *check_state(None, "/s")] == []


@pytest.mark.parametrize(("count", "found"), [(0, []), (1, [("node_name", INFO)]), (2, [("node_name", ERROR)])])
def test_nodes_of_the_relays_name(count, found):
    assert brief(check_own_name(replace(GRAPH, nodes=("/syncrelay",) * count), "/syncrelay")) == found


@pytest.mark.parametrize(
    ("has_clock", "use_sim_time", "found"),
    [(False, False, []), (False, True, []), (True, True, []), (True, False, [("clock_unused", INFO)])],
)
def test_a_clock_that_is_not_used(has_clock, use_sim_time, found):
    assert brief(check_clock(replace(GRAPH, has_clock=has_clock), use_sim_time=use_sim_time)) == found


def test_a_finding_of_the_relay_is_told_with_its_group_and_what_it_suggests():
    (found,) = check_groups([report(a_silent_group(unpublished("/camera"), an_input("/lidar")))], [])
    assert (found.code, found.severity) == ("no_publisher", ERROR)
    assert found.what == f"front: nobody publishes /camera ({IMAGE})"
    assert found.impact == "no sets from front"
    assert found.fix == "start the node that publishes /camera, or correct the topic's name"


def test_what_costs_a_group_only_some_sets_is_a_warning():
    strange = an_input(publishers=(Endpoint("/usb_cam", IMAGE), Endpoint("/other", "std_msgs/msg/Int64")))
    (found,) = check_groups([report(a_group(strange, an_input("/lidar")))], [])
    assert (found.code, found.severity, found.impact) == ("other_type", WARNING, None)


def test_what_several_groups_share_is_told_once():
    facts = a_silent_group(unpublished("/camera"), an_input("/lidar"))
    (found,) = check_groups([report(facts), report(replace(facts, name="rear"))], [])
    assert found.what.startswith("front and rear: nobody publishes /camera ")
    assert found.impact == "no sets from front and rear"


def test_a_silent_topic_leads_no_further_than_here():
    (found,) = check_groups([report(a_silent_group(silent(), an_input("/lidar")))], [])
    assert found.code == "silent"
    assert found.fix is not None
    assert "doctor" not in found.fix
    assert "FASTDDS_BUILTIN_TRANSPORTS=UDPv4" in found.fix


def test_a_managed_node_that_is_silent_is_told_with_its_state_and_one_that_was_heard_with_no_loss():
    (found,) = check_groups([report(a_silent_group(silent(managed=("/driver",)), an_input("/lidar")))], [])
    assert "`ros2 lifecycle get /driver`" in (found.fix or "")
    heard = an_input(figures={"rate_hz": 0.0, "last_received": NOW - 7 * S, "fed": 0})
    (found,) = check_groups([report(a_silent_group(heard, an_input("/lidar")))], [])
    assert found.code == "silent"
    assert "FASTDDS" not in (found.fix or "")


def test_nodes_on_other_domains_are_told_where_somebody_is_missing():
    whole, lacking = a_group(), a_silent_group(unpublished("/camera"), an_input("/lidar"))
    (found,) = check_domains(GRAPH, [report(lacking)], [0, 3, 42])
    assert (found.code, found.what) == ("other_domain", "nodes of this machine are on domains 0 and 42")
    assert list(check_domains(GRAPH, [report(lacking)], [3])) == []
    assert list(check_domains(GRAPH, [report(whole)], [0])) == []
    assert brief(check_domains(replace(GRAPH, nodes=()), [], [0])) == [("other_domain", INFO)]


def test_a_group_without_a_set_in_too_short_a_time_is_a_warning_and_a_healthy_one_is_nothing():
    starting = a_group(figures={"last_set": None, "sets": 0, "began": NOW - S})
    (found,) = check_groups([report(starting), report(a_group())], [])
    assert (found.code, found.severity) == ("starting", WARNING)
    assert found.fix == "run it again with a larger --seconds"


def test_a_group_that_could_not_be_judged_is_an_error():
    (found,) = check_groups([], ["rear"])
    assert (found.code, found.severity) == ("internal_error", ERROR)
    assert found.what.startswith("rear: ")


def test_messages_over_the_shared_memory_are_an_info_with_their_size():
    def sizes(**largest):
        inputs = [an_input(f"/{name}", largest=size) for name, size in largest.items()]
        return list(check_sizes([report(a_group(*inputs))]))

    assert sizes(image=524_288, cloud=0) == []
    (found,) = sizes(image=6_220_856, cloud=524_289)
    assert (found.code, found.severity) == ("large_messages", INFO)
    assert found.what.startswith("messages of /image (6.2 MB) and /cloud (0.5 MB) are larger than")
