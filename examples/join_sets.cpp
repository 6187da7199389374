// Joins the outputs /front/image and /front/imu of a relay into sets, by the manifest of the group front.
#include <cstdint>
#include <deque>
#include <map>
#include <string>

#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <sensor_msgs/msg/imu.hpp>

using diagnostic_msgs::msg::DiagnosticArray;
using diagnostic_msgs::msg::DiagnosticStatus;
using sensor_msgs::msg::Image;
using sensor_msgs::msg::Imu;
constexpr std::size_t KEEP = 500;

std::uint64_t value(const DiagnosticStatus & status, const std::string & key)
{
  for (const auto & pair : status.values) {
    if (pair.key == key) {return std::stoull(pair.value);}
  }
  return 0;
}

enum class State {THERE, NOT_YET, LOST};

// The messages of one output, by their sequence numbers.
template<class M>
struct Held
{
  std::map<std::uint64_t, typename M::ConstSharedPtr> messages;

  void add(const typename M::ConstSharedPtr & message, const rclcpp::MessageInfo & info)
  {
    const auto sequence = info.get_rmw_message_info().publication_sequence_number;
    if (!messages.empty() && sequence <= messages.rbegin()->first) {messages.clear();}  // The relay has begun again.
    messages[sequence] = message;
    if (messages.size() > KEEP) {messages.erase(messages.begin());}
  }

  // Finds the message that a manifest names; none, and THERE, for an input that is missing.
  State find(const DiagnosticStatus & told, typename M::ConstSharedPtr & message)
  {
    const auto sequence = value(told, "sequence");
    if (sequence == 0) {return State::THERE;}
    messages.erase(messages.begin(), messages.lower_bound(sequence));
    const auto found = messages.find(sequence);
    if (found == messages.end()) {return messages.empty() ? State::NOT_YET : State::LOST;}
    const auto & stamp = found->second->header.stamp;
    if (stamp.sec * 1000000000LL + stamp.nanosec != std::int64_t(value(told, "stamp_ns"))) {return State::LOST;}
    message = found->second;
    return State::THERE;
  }
};

class JoinSets : public rclcpp::Node
{
public:
  JoinSets() : Node("join_sets")
  {
    image_ = create_subscription<Image>("/front/image", KEEP,
      [this] (Image::ConstSharedPtr message, const rclcpp::MessageInfo & info) {images_.add(message, info); join();});
    imu_ = create_subscription<Imu>("/front/imu", KEEP,
      [this] (Imu::ConstSharedPtr message, const rclcpp::MessageInfo & info) {imus_.add(message, info); join();});
    sets_ = create_subscription<DiagnosticArray>("/syncrelay/front/sets", KEEP,
      [this] (DiagnosticArray::ConstSharedPtr manifest) {
        const auto number = value(manifest->status[0], "set");
        if (number <= number_) {manifests_.clear();}  // The group has begun again.
        number_ = number;
        manifests_.push_back(manifest);
        if (manifests_.size() > KEEP) {manifests_.pop_front();}
        join();
      });
  }

private:
  void join()
  {
    while (!manifests_.empty()) {
      const auto manifest = manifests_.front();
      Image::ConstSharedPtr image;
      Imu::ConstSharedPtr imu;
      const auto of_image = images_.find(manifest->status[1], image);
      const auto of_imu = imus_.find(manifest->status[2], imu);
      if (of_image == State::NOT_YET || of_imu == State::NOT_YET) {return;}
      manifests_.pop_front();
      if (of_image == State::THERE && of_imu == State::THERE) {take(value(manifest->status[0], "set"), image, imu);}
    }
  }

  // A null pointer stands for what is missing.
  void take(std::uint64_t number, Image::ConstSharedPtr image, Imu::ConstSharedPtr imu)
  {
    RCLCPP_INFO(get_logger(), "set %lu: image %d, imu %d", number, bool(image), bool(imu));
  }

  Held<Image> images_;
  Held<Imu> imus_;
  std::deque<DiagnosticArray::ConstSharedPtr> manifests_;
  std::uint64_t number_ = 0;
  rclcpp::Subscription<Image>::SharedPtr image_;
  rclcpp::Subscription<Imu>::SharedPtr imu_;
  rclcpp::Subscription<DiagnosticArray>::SharedPtr sets_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<JoinSets>());
  rclcpp::shutdown();
}
