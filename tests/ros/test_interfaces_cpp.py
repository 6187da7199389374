"""The C++ consumer in the README of a written package compiles against the header that ROS's generator makes of it.

Neither PyPI nor Debian has rclcpp. What the consumer uses of it is declared here as rclcpp 28 (Jazzy) declares it.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.command import run_here
from tests.ros.configs import config, inputs

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++: apt-get install g++"),
]

_RCLCPP = """\
#pragma once
#include <cstdio>
#include <functional>
#include <memory>
#include <string>

namespace rclcpp {
struct QoS {};
struct SensorDataQoS : QoS {};
struct Logger {};
template<typename T> struct Subscription {};
void init(int argc, char const * const * argv);
struct Node {
  explicit Node(const std::string & name);
  Logger get_logger() const;
  template<typename T, typename Callback>
  std::shared_ptr<Subscription<T>> create_subscription(const std::string &, const QoS &, Callback && take) {
    std::function<void(std::shared_ptr<const T>)> taken = take;
    return nullptr;
  }
};
void spin(std::shared_ptr<Node> node);
}
#define RCLCPP_INFO(logger, ...) do {(void)(logger); std::printf(__VA_ARGS__);} while (0)
"""
_GENERATE = """\
import sys
from pathlib import Path
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_cpp.cli import GenerateCpp
from rosidl_generator_type_description.cli import HashTypeDescription

folder, output, share = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
messages = [each.relative_to(folder) for each in folder.glob("msg/*.msg")]
for message in messages:
    convert_msg_to_idl(folder, folder.name, message, output / "msg")
sources = [f"{output}:{each.with_suffix('.idl')}" for each in messages]
hashes = HashTypeDescription("hash").generate_type_hashes(folder.name, sources, [share, str(output.parent)], output)
GenerateCpp("cpp").generate(folder.name, sources, [share], output, hashes)
"""


def test_the_cpp_consumer_of_the_readme_compiles(tmp_path: Path):
    topics = inputs({"/camera/image": "sensor_msgs/msg/Image", "/imu": "sensor_msgs/msg/Imu"})
    (tmp_path / "rig.yaml").write_text(config({"front": {"policy": "exact_time", "topics": topics}}))
    assert run_here("interfaces", "rig.yaml", folder=tmp_path).returncode == 0
    package = tmp_path / "rig_interfaces"
    consumer = re.search(r"```cpp\n(.*?)```", (package / "README.md").read_text(), re.DOTALL)
    assert consumer is not None
    (tmp_path / "consumer.cpp").write_text(consumer[1])
    headers, prefix = tmp_path / "include", Path(sys.prefix)
    (headers / "rclcpp").mkdir(parents=True)
    (headers / "rclcpp/rclcpp.hpp").write_text(_RCLCPP)
    subprocess.run(
        [sys.executable, "-c", _GENERATE, package, headers / package.name, prefix / "share"],
        env=os.environ | {"AMENT_PREFIX_PATH": str(prefix)},
        check=True,
        capture_output=True,
    )
    # Headers of all packages lie in include/<package>, in the wheels as where ROS is installed.
    includes = [prefix / "include", *filter(Path.is_dir, (prefix / "include").iterdir())]
    flags = ["-std=c++17", "-Wall", "-Werror", "-fsyntax-only", f"-I{headers}"]
    flags += [f"-isystem{each}" for each in includes]
    compiler = shutil.which("g++") or ""
    done = subprocess.run([compiler, *flags, tmp_path / "consumer.cpp"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
