"""The process that starts the node: a plan as JSON on stdin, then an object on stdout for each step begun or done."""

import json
import os
import sys
from typing import Any

from syncrelay.doctor.start import Step
from syncrelay.errors import RosUnavailableError, TypeImportError, UsageError
from syncrelay.relay.types import import_type
from syncrelay.ros.environment import require_rclpy


def main() -> int:
    """Try, and return 1 at the first step that fails."""
    plan = json.load(sys.stdin)
    try:
        _say(Step.IMPORT)
        require_rclpy()
        _import_types(plan["types"])
        _start(plan)
    except RosUnavailableError as error:
        _say(Step.IMPORT, fault=str(error))
        return 1
    return 0


def _import_types(types: list[str]) -> None:
    unusable: dict[str, str] = {}
    for name in types:
        _say(Step.TYPES, type=name, unusable=unusable)
        try:
            import_type(name)
        except TypeImportError as error:
            unusable[name] = str(error.__cause__ or error).splitlines()[0]
    _say(Step.TYPES, type=None, unusable=unusable)


def _start(plan: dict[str, Any]) -> None:
    from rclpy.utilities import get_rmw_implementation_identifier  # noqa: PLC0415  after require_rclpy

    from syncrelay.ros.leaving import is_leaving, leave  # noqa: PLC0415  for those who start
    from syncrelay.ros.start import make_node, resolver, start  # noqa: PLC0415  after require_rclpy

    ros_args = plan["ros_args"]
    step = Step.INIT
    _say(step, middleware=get_rmw_implementation_identifier())
    try:
        context = start(ros_args, simulated=plan["use_sim_time"])
        step = Step.NODE
        _say(step)
        node = make_node(plan["node"], namespace=plan["namespace"], context=context, ros_args=ros_args)
        resolve = resolver(node, ros_args)
        names = {name: resolve(name) for name in plan["names"]}
    except UsageError as error:
        _say(Step.ARGUMENTS, fault=str(error))
        return
    except RosUnavailableError as error:
        _say(step, fault=str(error.__cause__ or error))
        return
    _say(
        Step.NAMES,
        node=node.get_fully_qualified_name(),
        names=names,
        use_sim_time=bool(node.get_parameter("use_sim_time").value),
        **_path(node, context),
    )
    leave(node, context)
    if is_leaving():
        os._exit(0)


def _path(node: Any, context: Any) -> dict[str, str]:
    """Find how messages would pass, as the fields of StartResult."""
    from syncrelay.ros.backend_choice import RCLPY_COSTS, VARIABLE, find_backend  # noqa: PLC0415  after require_rclpy

    try:
        backend, fault = find_backend(os.environ.get(VARIABLE), node=node, context=context)
    except (UsageError, RosUnavailableError) as error:
        return {"path_fault": str(error)}
    found = {"path": backend.name.value}
    if fault is None:
        return found
    return found | {"path_fault": fault.what, "path_cost": RCLPY_COSTS, "path_advice": fault.advice}


def _say(step: Step, **facts: Any) -> None:
    sys.stdout.write(json.dumps({"step": step.value, **facts}) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
