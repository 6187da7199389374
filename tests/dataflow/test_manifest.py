"""The manifest as bytes: what is written by hand is what others read, and what could not be published is told."""

from hypothesis import given
from hypothesis import strategies as st

from syncrelay.dataflow.manifest import ManifestWriter
from tests.dataflow.payloads import group_of
from tests.ros.cdr_messages import NS_PER_SECOND, STORE
from tests.ros.manifests import ERROR, MANIFEST_TYPE, OK, STALE, WARN, Member, Told, ToldInput, note, read

_NAMES = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,40}", fullmatch=True)
_STAMPS = st.integers(-(2**31) * NS_PER_SECOND, 2**31 * NS_PER_SECOND - 1)
_TIMES = st.integers(-(2**63), 2**63 - 1)
_COUNTS = st.integers(0, 2**64)
_WHY = st.one_of(st.just(""), st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=80))
_MEMBERS = st.builds(Member, _STAMPS, _STAMPS, _TIMES, _COUNTS, _WHY)


@given(data=st.data(), name=_NAMES, node=_NAMES, number=_COUNTS, latency=_TIMES)
def test_others_read_what_was_written(data, name, node, number, latency):
    tokens = data.draw(st.lists(_NAMES, min_size=2, max_size=5, unique=True))
    members = data.draw(st.lists(st.one_of(st.none(), _MEMBERS), min_size=len(tokens), max_size=len(tokens)))
    if not any(members):
        members[0] = data.draw(_MEMBERS)
    common = data.draw(st.one_of(st.none(), _STAMPS))
    topics = [(f"/{each}", f"/out/{each}") for each in tokens]
    bundle = data.draw(st.one_of(st.none(), _NAMES.map("/{}".format)))
    unbundled = data.draw(st.one_of(st.none(), _WHY)) if bundle else None
    config = group_of(name=name, topics=[each for each, _ in topics]).config
    writer = ManifestWriter(config, node=f"/{node}", topics=topics, bundle=bundle)
    given = note(number, members, common=common, latency=latency)._replace(bundle=number - 1)
    if unbundled is not None:
        given = given._replace(unpublished={**given.unpublished, len(members): unbundled})
    # Each as if it were alone.
    other = note(number, members[::-1], common=common, latency=number)
    payload, _ = manifests = writer.write([given, other])
    assert [*writer.write([given]), *writer.write([other])] == manifests

    told = read(payload)
    stamps = [each.original_stamp for each in members if each is not None]
    missing, unpublished = members.count(None), sum(bool(each and each.why_not) for each in members)
    counts = {"missing": missing, "not published": unpublished}
    faults = ", ".join(
        [f"{count} of {len(members)} {what}" for what, count in counts.items() if count]
        + ([] if unbundled is None else [f"bundle not published: {unbundled}"])
    )
    assert told._replace(inputs=()) == Told(
        stamp=max(stamps) if common is None else common,
        level=ERROR if unpublished or unbundled is not None else WARN if missing else OK,
        group=name,
        message=faults or "complete",
        node=f"/{node}",
        number=number,
        missing=missing,
        span=max(stamps) - min(stamps),
        latency=latency,
        common_stamp=common,
        policy="exact_time",
        inputs=(),
        bundle=bundle,
        bundle_sequence=None if bundle is None else str(number - 1),
    )
    assert told.inputs == tuple(
        ToldInput(STALE, output, topic, "missing")
        if each is None
        else ToldInput(
            ERROR if each.why_not else OK,
            *(output, topic, each.why_not),
            *(each.sequence, each.stamp, each.original_stamp, each.received),
        )
        for (topic, output), each in zip(topics, members, strict=True)
    )
    # There is one way to write CDR: no byte more, none else where strings are aligned.
    assert payload == bytes(STORE.serialize_cdr(STORE.deserialize_cdr(payload, MANIFEST_TYPE), MANIFEST_TYPE))


def test_a_long_reason_is_told_in_part():
    group = group_of(topics=["/a", "/b"])
    writer = ManifestWriter(group.config, node="/n", topics=[("/a", "/x"), ("/b", "/y")], bundle=None)
    members = [Member(1, 1, 1, 0, "no room\0, " * 100), Member(1, 1, 1, 1)]
    assert 0 < len(read(*writer.write([note(1, members)])).inputs[0].message) <= 200
