"""The files of a package with messages that hold sets: what colcon builds, and what its reader wants to know."""

import re
from collections.abc import Iterator, Sequence
from string import Template
from typing import Final

from syncrelay.config.message_package import SetMessage
from syncrelay.printable import printable

_OF_HEAD: Final = ("builtin_interfaces", "std_msgs")

_PACKAGE: Final = Template("""\
<?xml version="1.0"?>
<package format="3">
  <name>$package</name>
  <version>0.0.0</version>
  <description>The sets of $source, one message each, as syncrelay publishes them.</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>TODO: License declaration</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
$depends
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
""")

_CMAKE: Final = Template("""\
cmake_minimum_required(VERSION 3.20)
project($package)

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
$found

rosidl_generate_interfaces($${PROJECT_NAME}
$files
  DEPENDENCIES $depends
)

ament_export_dependencies(rosidl_default_runtime)
ament_package()
""")

_README: Final = Template("""\
# $package

A message for each group of `$source`, in which syncrelay publishes the group's sets. Written by `syncrelay interfaces`.

Build it in a workspace, and source that where the relay and its consumers run:

```sh
colcon build --packages-select $package && source install/setup.bash
```

In the file, each group gets its bundle. `outputs: false` beside it switches the separate topics off.

```yaml
groups:
$bundles
```

A consumer in Python:

```python
import rclpy
from rclpy.qos import qos_profile_sensor_data
from $package.msg import $name


def take(whole: $name) -> None:
    print(whole.number, whole.header.stamp, "without", whole.missing)


rclpy.init()
node = rclpy.create_node("consumer")
node.create_subscription($name, "$topic", take, qos_profile_sensor_data)
rclpy.spin(node)
```

And in C++:

```cpp
#include <rclcpp/rclcpp.hpp>
#include <$package/msg/$header.hpp>
using $package::msg::$name;

int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  auto node = std::make_shared<rclcpp::Node>("consumer");
  auto subscription = node->create_subscription<$name>("$topic", rclcpp::SensorDataQoS(),
    [&] ($name::ConstSharedPtr whole) {RCLCPP_INFO(node->get_logger(), "set %lu", whole->number);});
  rclcpp::spin(node);
}
```

A bundle is offered with what all inputs are received with. Both consumers request best effort, so they get the sets of
any sensors. Where all inputs are reliable, a reliable consumer gets them too.
""")


def files_of(package: str, messages: Sequence[SetMessage], *, source: str) -> Iterator[tuple[str, str]]:
    """Yield the files of the package, by their paths in it; `source` is the name of the file they are made of."""
    types = {type_name.partition("/")[0] for each in messages for _, type_name, _ in each.fields}
    depends = sorted(types.union(_OF_HEAD))
    shown = printable(source)
    yield (
        "package.xml",
        _PACKAGE.substitute(
            package=package,
            source=shown.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;"),
            depends="\n".join(f"  <depend>{each}</depend>" for each in depends),
        ),
    )
    yield (
        "CMakeLists.txt",
        _CMAKE.substitute(
            package=package,
            found="\n".join(f"find_package({each} REQUIRED)" for each in depends),
            files="\n".join(f'  "msg/{each.name}.msg"' for each in messages),
            depends=" ".join(depends),
        ),
    )
    yield "README.md", _readme(package, messages, shown)
    for each in messages:
        yield f"msg/{each.name}.msg", each.text


def _readme(package: str, messages: Sequence[SetMessage], source: str) -> str:
    first = messages[0]
    return _README.substitute(
        package=package,
        source=source,
        bundles="\n".join(f"  {each.group}:\n    bundle: {_bundle(package, each)}" for each in messages),
        name=first.name,
        # As rosidl names the header of a message.
        header=re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", first.name).lower(),
        topic=first.topic,
    )


def _bundle(package: str, each: SetMessage) -> str:
    fields = ", ".join(f"{field}: {topic}" for field, topic in each.named.items())
    return f"{{topic: {each.topic}, type: {package}/msg/{each.name}{f', fields: {{{fields}}}' if fields else ''}}}"
