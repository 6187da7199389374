"""A process that calls services of other nodes. Run as `python -m tests.ros.caller`.

It takes commands on stdin, one a line, and answers each with a line on stdout, a JSON value:

    call NAME               std_srvs/srv/Trigger: [success, message]
    begin NAME              the same without waiting: null; `end` waits for it
    end                     the answers to all that was begun and not ended yet, in the order of the calls
    get NODE NAME ...       the values of a node's parameters, null of one that it does not have
    set NODE NAME VALUE     set a parameter to a JSON value: [successful, reason]
    services                the names of all services in the graph

It ends when stdin does.
"""

import json
import sys
import time
from typing import Any

import rclpy
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_default_context
from std_srvs.srv import Trigger

from syncrelay.ros.environment import keep_stdout
from syncrelay.ros.leaving import leave
from tests.ros.processes import DEADLINE_S


def main() -> None:
    # Fast DDS's own lines would be taken for answers.
    keep_stdout()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("caller")
    caller = _Caller(node)
    commands: dict[str, Any] = {
        "call": caller.call,
        "begin": caller.begin,
        "end": caller.end,
        "get": caller.get,
        "set": caller.set,
        "services": caller.services,
    }
    for line in sys.stdin:
        command, *words = line.split()
        print(json.dumps(commands[command](*words)), flush=True)  # noqa: T201  the answer
    leave(node, get_default_context())


class _Caller:
    def __init__(self, node: Any) -> None:
        self._node = node
        self._clients: dict[str, Any] = {}
        self._begun: list[Any] = []

    def call(self, name: str) -> object:
        return _told(self._result(self._asked(Trigger, name, Trigger.Request())))

    def begin(self, name: str) -> None:
        self._begun.append(self._asked(Trigger, name, Trigger.Request()))

    def end(self) -> object:
        begun, self._begun = self._begun, []
        return [_told(self._result(future)) for future in begun]

    def get(self, node: str, *names: str) -> object:
        answer = self._result(self._asked(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names)))
        return [parameter_value_to_python(value) for value in answer.values]

    def set(self, node: str, name: str, value: str) -> object:
        wanted = Parameter(name, value=json.loads(value)).to_parameter_msg()
        request = SetParameters.Request(parameters=[wanted])
        (result,) = self._result(self._asked(SetParameters, f"{node}/set_parameters", request)).results
        return [result.successful, result.reason]

    def services(self) -> object:
        return [name for name, _ in self._node.get_service_names_and_types()]

    def _asked(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name)
            if not self._clients[name].wait_for_service(DEADLINE_S):
                raise TimeoutError(f"nobody offers {name}")
        return self._clients[name].call_async(request)

    def _result(self, future: Any) -> Any:
        end = time.monotonic() + DEADLINE_S
        while not future.done():
            if time.monotonic() > end:
                raise TimeoutError("a call was not answered")
            rclpy.spin_once(self._node, timeout_sec=1)
        return future.result()


def _told(response: Any) -> list[object]:
    return [response.success, response.message]


if __name__ == "__main__":
    main()
