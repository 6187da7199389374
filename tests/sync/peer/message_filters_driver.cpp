// Runs the C++ message_filters of Debian's libmessage-filters-dev on streams read from stdin.
//
// In:  approximate N QUEUE AGE_PENALTY SLOP_NS LOWER_BOUND_NS*N EVENTS then (INPUT STAMP_NS)*EVENTS
//      exact N QUEUE EVENTS then (INPUT STAMP_NS)*EVENTS
// Out: per stream, `set EVENT MEMBER*N` for each set and `drop EVENT MEMBER` for each message that exact reports as dropped,
//      both by index of the event during which it left, then `end`. SLOP_NS -1 leaves the default.

#include <cstdint>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include <message_filters/sync_policies/approximate_time.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>

struct Stamped {
  ros::Time stamp;
  long event;
};

namespace ros {
namespace message_traits {
template <>
struct TimeStamp<Stamped> {
  static ros::Time value(const Stamped& message) { return message.stamp; }
};
}  // namespace message_traits
}  // namespace ros

using message_filters::NullType;
using Event = std::pair<int, int64_t>;

long current_event;

void print_member(const boost::shared_ptr<Stamped const>& message) { std::cout << ' ' << message->event; }
void print_member(const boost::shared_ptr<NullType const>&) {}

void print_drop(const boost::shared_ptr<Stamped const>& message) {
  if (message) std::cout << "drop " << current_event << ' ' << message->event << '\n';
}
void print_drop(const boost::shared_ptr<NullType const>&) {}

struct PrintSet {
  using result_type = void;  // boost::bind asks for it

  template <class... Pointers>
  void operator()(const Pointers&... members) const {
    std::cout << "set " << current_event;
    (print_member(members), ...);
    std::cout << '\n';
  }
};

struct PrintDrops {
  using result_type = void;

  template <class... Pointers>
  void operator()(const Pointers&... members) const {
    (print_drop(members), ...);
  }
};

template <int I, int N, class Synchronizer>
void add(Synchronizer& synchronizer, int input, const boost::shared_ptr<Stamped const>& message) {
  if constexpr (I < N) {
    if (input == I)
      synchronizer.template add<I>(ros::MessageEvent<Stamped const>(message, message->stamp));
    else
      add<I + 1, N>(synchronizer, input, message);
  }
}

template <int N, class Synchronizer>
void feed(Synchronizer& synchronizer, const std::vector<Event>& events) {
  PrintSet print_set;
  synchronizer.registerCallback(print_set);
  current_event = 0;
  for (const Event& event : events) {
    boost::shared_ptr<Stamped> message(new Stamped);
    message->stamp.fromNSec(event.second);
    message->event = current_event;
    add<0, N>(synchronizer, event.first, message);
    ++current_event;
  }
}

template <int N, int I>
using Type = std::conditional_t<(I < N), Stamped, NullType>;

template <template <class, class, class, class, class, class, class, class, class> class Policy, int N>
using Of = Policy<Type<N, 0>, Type<N, 1>, Type<N, 2>, Type<N, 3>, Type<N, 4>, Type<N, 5>, Type<N, 6>, Type<N, 7>, Type<N, 8>>;

std::vector<Event> read_events() {
  size_t count;
  std::cin >> count;
  std::vector<Event> events(count);
  for (Event& event : events) std::cin >> event.first >> event.second;
  return events;
}

template <int N>
void approximate(int queue_size) {
  double age_penalty;
  int64_t slop;
  std::cin >> age_penalty >> slop;
  message_filters::Synchronizer<Of<message_filters::sync_policies::ApproximateTime, N>> synchronizer(
      Of<message_filters::sync_policies::ApproximateTime, N>(static_cast<uint32_t>(queue_size)));
  synchronizer.setAgePenalty(age_penalty);
  if (slop >= 0) synchronizer.setMaxIntervalDuration(ros::Duration().fromNSec(slop));
  for (int input = 0; input < N; ++input) {
    int64_t bound;
    std::cin >> bound;
    synchronizer.setInterMessageLowerBound(input, ros::Duration().fromNSec(bound));
  }
  feed<N>(synchronizer, read_events());
}

template <int N>
void exact(int queue_size) {
  message_filters::Synchronizer<Of<message_filters::sync_policies::ExactTime, N>> synchronizer(
      Of<message_filters::sync_policies::ExactTime, N>(static_cast<uint32_t>(queue_size)));
  PrintDrops print_drops;
  synchronizer.registerDropCallback(print_drops);
  feed<N>(synchronizer, read_events());
}

template <int N>
void run(const std::string& policy, int inputs, int queue_size) {
  if constexpr (N > 9) {
    std::cerr << "2 to 9 inputs\n";
    std::exit(2);
  } else if (inputs != N) {
    run<N + 1>(policy, inputs, queue_size);
  } else if (policy == "exact") {
    exact<N>(queue_size);
  } else {
    approximate<N>(queue_size);
  }
}

int main() {
  std::string policy;
  int inputs, queue_size;
  while (std::cin >> policy >> inputs >> queue_size) {
    run<2>(policy, inputs, queue_size);
    std::cout << "end\n";
  }
}
