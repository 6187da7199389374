// Runs tf2's BufferCore of Debian's libtf2-dev on what is read from stdin, a line each:
//
//   transform PARENT CHILD STAMP_NS IS_STATIC   takes a transform
//   clear                                       as tf2_ros does when the clock jumps back
//   can TARGET SOURCE STAMP_NS                  prints 1 where canTransform says so, else what it says; "-" is an empty frame
//   end                                         begins anew, with an empty buffer

#include <iostream>
#include <memory>
#include <string>

#include <geometry_msgs/TransformStamped.h>
#include <tf2/buffer_core.h>

ros::Time time_of(int64_t ns) {
  ros::Time time;
  return time.fromNSec(ns);
}

int main() {
  auto buffer = std::make_unique<tf2::BufferCore>();
  std::string word, parent, child;
  int64_t stamp;
  bool is_static;
  while (std::cin >> word) {
    if (word == "transform") {
      std::cin >> parent >> child >> stamp >> is_static;
      geometry_msgs::TransformStamped transform;
      transform.header.stamp = time_of(stamp);
      transform.header.frame_id = parent;
      transform.child_frame_id = child;
      transform.transform.rotation.w = 1;
      buffer->setTransform(transform, "driver", is_static);
    } else if (word == "clear") {
      buffer->clear();
    } else if (word == "can") {
      std::cin >> parent >> child >> stamp;
      if (child == "-") child.clear();
      std::string why;
      bool can = buffer->canTransform(parent, child, time_of(stamp), &why);
      why = why.substr(0, why.find('\n'));
      std::cout << (can ? "1" : why.empty() ? "0" : why) << '\n';
    } else if (word == "end") {
      buffer = std::make_unique<tf2::BufferCore>();
    }
  }
}
