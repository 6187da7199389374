"""The file: what `validate` finds in it, what remaps make of its names, and whether its address can be had."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

from syncrelay.config import Config, Listen, Problem, Severity, render
from syncrelay.config.typechecks import TF_INSTALL
from syncrelay.config.wording import all_of, counted
from syncrelay.doctor.diagnosis import Diagnosis, error, info
from syncrelay.errors import ListenError

# The name of a check is a contract: these are older than the sentences of the file.
_REMAP_CODES: Final = {"loop": "remap_loop", "repeated_output": "remap_outputs"}


def check_files(files: Sequence[str], problems: Sequence[Problem]) -> Iterator[Diagnosis]:
    """Yield what is wrong with files that run together. A package that is missing is this environment's fault."""
    together = "--together " if len(files) > 1 else ""
    named = all_of(files) if files else ""
    errors = [problem for problem in problems if problem.severity is Severity.ERROR]
    warnings = [problem for problem in problems if problem.severity is Severity.WARNING]
    noted = [problem for problem in problems if problem.severity is Severity.NOTE]
    missing = [replace(each, severity=Severity.ERROR) for each in noted if each.code == "package_missing"]
    refused = [replace(each, severity=Severity.ERROR) for each in noted if each.code == "transforms_missing"]
    unchecked = [problem for problem in noted if problem.code not in ("package_missing", "transforms_missing")]
    if errors:
        yield error(
            "file",
            f"{counted(len(errors), 'error')} in {named}:\n{render(errors)}",
            impact="the relay refuses the file and exits at once",
            fix=f"fix what is marked, then check again: syncrelay validate {together}{' '.join(files)}",
        )
    if warnings:
        yield info(
            "file_doubtful",
            f"{named} may not mean what you intended:\n{render(warnings)}",
            impact="the relay does what it says",
            fix="write what you mean, with its unit",
        )
    if missing:
        yield error(
            "package_missing",
            f"{named} uses message types of packages that are not installed here:\n{render(missing)}",
            impact="the relay starts, but the groups with these types wait until the packages are there",
            fix="build the packages with colcon for this Python, then in this shell: source install/setup.bash\n"
            "(for the image: put them into docker/messages before you build it)",
        )
    if refused:
        yield error(
            "transforms_missing",
            f"{named} lets sets wait for transforms, and the type of /tf is not installed here:\n{render(refused)}",
            impact="the relay refuses the file and exits at once",
            fix=TF_INSTALL.replace("`", ""),
        )
    if unchecked:
        yield info(
            "not_checked",
            f"{named} could not be checked completely:\n{render(unchecked)}",
            impact="an error in these places shows only when the relay runs",
            fix="nothing, if you are sure that they are right",
        )


def check_types(config: Config, unusable: Mapping[str, str]) -> Iterator[Diagnosis]:
    """Yield types of the file that are installed but cannot be used; `unusable` has the fault of each."""
    for name, fault in unusable.items():
        users = [(topic, group) for group in config.groups for topic in group.topics if topic.type == name]
        topics = all_of(dict.fromkeys(topic.topic for topic, _ in users))
        groups = all_of(dict.fromkeys(group.name for _, group in users))
        yield error(
            "type_unusable",
            f"{name} is installed but cannot be imported: {fault}",
            impact=f"the relay receives nothing on {topics}, so the group {groups} waits",
            fix=f"rebuild {name.partition('/')[0]} for this Python and this ROS, and source it in this shell",
        )


def check_remaps(config: Config, names: Mapping[str, str]) -> Iterator[Diagnosis]:
    """Yield what is wrong with the file only after remaps; `names` has what each name of the file becomes."""
    problems = config.names.problems(names.__getitem__, groups=[group.name for group in config.groups])
    for code in dict.fromkeys(problem.code for problem in problems):
        yield error(
            _REMAP_CODES.get(code, f"remap_{code}"),
            f"after remapping, the relay refuses these names of the file:\n"
            f"{render([problem for problem in problems if problem.code == code])}",
            impact="the relay exits at once with code 1; on a reload it keeps the running configuration",
            fix="remove the remap, or give the topic another name in the file",
        )


def check_listen(listen: Listen | None) -> Iterator[Diagnosis]:
    """Yield that the address that the file asks for cannot be had; the relay that runs already may be why."""
    if listen is None or not listen.is_asked_for:
        return
    # The web server's packages are not needed to look at a broken installation.
    from syncrelay.status.server import Server  # noqa: PLC0415

    try:
        with Server(listen):
            pass
    except ListenError as error:
        yield info(
            "listen",
            str(error),
            impact="the relay exits at once with code 1, unless it is the one that listens there already",
            fix="`syncrelay top` shows whether a relay answers there; if not, give `metrics` another `listen`",
        )
