"""The sections of a file beside its groups: the node, HTTP, and what the relay publishes about itself."""

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from syncrelay.config.keys import NOT_NULL, Host, Keys, ListenAddress, Namespace, NodeName
from syncrelay.config.names import expand

Transport: TypeAlias = Literal["default", "large_messages"]


class NodeConfig(Keys):
    """The ROS node. Remaps and parameters after --ros-args take precedence."""

    name: NodeName = Field(
        default="syncrelay", description="Name of the node. Default: syncrelay.", examples=["syncrelay"]
    )
    namespace: Namespace = Field(
        default="",
        description="Namespace of the node, for relative and `~/` topic names. Default: empty, the root.",
        examples=["/robot1"],
    )
    use_sim_time: bool = Field(
        default=False,
        description="Take the time from /clock, as with a simulation or a bag played with --clock. Default: false.",
    )
    transport: Transport = Field(
        default="default",
        description=(
            "How Fast DDS carries messages of this node. `large_messages` uses shared memory for images and clouds"
            " larger than 0.5 MB; publishers and subscribers need it too, see configs/large_messages.xml. Transports"
            " set in the environment take precedence. Default: default."
        ),
        examples=["default", "large_messages"],
    )
    lifecycle: bool = Field(
        default=False,
        description=(
            "Make it a managed node: it starts unconfigured, and `ros2 lifecycle set`, a launch file or nav2's"
            " lifecycle manager configures and activates it. Default: false, it starts active."
        ),
    )
    services: bool = Field(
        default=True,
        description=(
            "Offer the services ~/reload, ~/status, ~/pause and ~/resume, which anyone on the ROS graph can call."
            " Default: true."
        ),
    )

    def absolute(self, name: str) -> str:
        """Return the absolute name of a topic that the file names, before any remapping."""
        return expand(name, node=self.name, namespace=self.namespace)


class ReadyConfig(Keys):
    """When the relay is ready, beside what it needs to be at all."""

    share: float = Field(
        gt=0,
        le=1,
        description=(
            "The share of its possible sets that each group has to give, of the last seconds, above 0 to 1. Before it"
            " is known the relay is not ready; groups that are lazy and sleep do not count."
        ),
        examples=[0.8],
    )


class MetricsConfig(Keys):
    """HTTP for programs and people: /status, which `syncrelay top` shows, /metrics, /livez and /readyz."""

    listen: Annotated[ListenAddress | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Where to listen, HOST:PORT; 0.0.0.0 is every interface, port 0 any free one."
            " Default: the first free port of 127.0.0.1:9464 to 9473."
        ),
        examples=["127.0.0.1:9464"],
    )
    hosts: tuple[Host, ...] = Field(
        default=(),
        description=(
            "Other host names that requests may use, such as that of a Kubernetes service. Under any other name no page"
            " in a browser can read the status. Names of this machine, and addresses if `listen` is open to other"
            " machines, need not be listed. Default: none."
        ),
        examples=[["robot.lab.example"]],
    )
    ready: Annotated[ReadyConfig | None, NOT_NULL] = Field(
        default=None,
        description=(
            "What /readyz waits for beside publishers that fit: sets. Default: sets may still be missing when it says"
            " that the relay is ready."
        ),
        examples=[{"share": 0.8}],
    )


class DiagnosticsConfig(Keys):
    """What is published about the relay: /diagnostics once a second, with a status for each group."""

    scalars: bool = Field(
        default=False,
        description=(
            "Publish figures of each group as std_msgs/msg/Float64 too, for plotting: ~/GROUP/sets_hz, ~/GROUP/span_ms"
            " and ~/GROUP/latency_ms. Default: false."
        ),
    )
