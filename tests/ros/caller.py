"""Services of a node, called by a node of the test's own process."""

import time
from collections.abc import Mapping
from typing import Any

from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import Trigger

from syncrelay.ros.leaving import leave
from tests.ros.in_process import joined
from tests.ros.processes import DEADLINE_S


class Caller:
    """Calls the services of one node, on its domain. What is not answered in time is an error."""

    def __init__(self, node: str, *, domain: int, environment: Mapping[str, str]) -> None:
        self.called = node
        self._context, self.node = joined("caller", domain=domain, environment=environment)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._clients: dict[str, Any] = {}
        self._begun: list[Any] = []

    def call(self, service: str) -> tuple[bool, str]:
        """Call ~/service; whether it succeeded, and its words."""
        answer = self.ask(Trigger, service)
        return answer.success, answer.message

    def begin(self, service: str) -> None:
        """Call ~/service without waiting for the answer, for which `end` waits."""
        self._begun.append(self._future(Trigger, service))

    def end(self) -> list[tuple[bool, str]]:
        """The answers to all that was begun, in the order of the calls."""
        begun, self._begun = self._begun, []
        return [(answer.success, answer.message) for answer in map(self._result, begun)]

    def get(self, *names: str) -> list[object]:
        """The values of parameters, None of one that the node does not have."""
        return [
            parameter_value_to_python(each) for each in self.ask(GetParameters, "get_parameters", names=names).values
        ]

    def set(self, name: str, value: object) -> tuple[bool, str]:
        """Set a parameter; whether it was, and why not."""
        wanted = Parameter(name, value=value).to_parameter_msg()
        (result,) = self.ask(SetParameters, "set_parameters", parameters=[wanted]).results
        return result.successful, result.reason

    def services(self) -> list[str]:
        """The names of all services in the graph."""
        return [name for name, _ in self.node.get_service_names_and_types()]

    def ask(self, kind: Any, service: str, **request: Any) -> Any:
        """Call a service of any kind below the node's name; its answer."""
        self._be_found(self._client(kind, service))
        return self._result(self._future(kind, service, **request))

    def spin(self) -> None:
        """Take what has come on subscriptions."""
        self._executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self._executor.shutdown()
        leave(self.node, self._context)

    def _client(self, kind: Any, service: str) -> Any:
        name = f"{self.called}/{service}"
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name)
        if not self._clients[name].wait_for_service(DEADLINE_S):
            raise TimeoutError(f"nobody offers {name}")
        return self._clients[name]

    def _be_found(self, client: Any) -> None:
        """Wait until the node has found a client: rmw drops an answer to one that it finds 100 ms later.

        Nothing tells, but a node finds what another made in that order. So one that is made after it is answered, with
        something that may be asked again, until it is.
        """
        later = self.node.create_client(GetParameters, f"{self.called}/get_parameters")
        later.wait_for_service(DEADLINE_S)
        end = time.monotonic() + DEADLINE_S
        try:
            while time.monotonic() < end:
                answer = later.call_async(GetParameters.Request())
                self._executor.spin_until_future_complete(answer, timeout_sec=1)
                if answer.done():
                    return
        finally:
            self.node.destroy_client(later)
        raise TimeoutError(f"{self.called} does not find {client.srv_name}")

    def _future(self, kind: Any, service: str, **request: Any) -> Any:
        return self._client(kind, service).call_async(kind.Request(**request))

    def _result(self, future: Any) -> Any:
        end = time.monotonic() + DEADLINE_S
        while not future.done():
            if time.monotonic() > end:
                raise TimeoutError("a call was not answered")
            self._executor.spin_once(timeout_sec=1)
        return future.result()
