// The floor: a relay of bytes on rcl alone, which neither matches nor reads anything.
//
//     floor [held | joined] TYPE INPUT OUTPUT [TYPE INPUT OUTPUT ...]        TYPE is Image or Imu
//
// With `held`, a message of each input waits until the last input has come, and then all leave; with `joined`, their
// bytes leave on the first output in one.
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rmw/rmw.h>
#include <sensor_msgs/msg/image.h>
#include <sensor_msgs/msg/imu.h>

static volatile sig_atomic_t ended;

static void end(int number)
{
  (void)number;
  ended = 1;
}

static void require(rcl_ret_t code, const char * what)
{
  if (code != RCL_RET_OK) {
    fprintf(stderr, "%s: %d: %s\n", what, (int)code, rcl_get_error_string().str);
    exit(1);
  }
}

static const rosidl_message_type_support_t * type_of(const char * name)
{
  return strcmp(name, "Imu") == 0 ? ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, Imu)
                                  : ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, Image);
}

// Add a message's bytes behind those that are there, into memory that is used again.
static void append(rcl_serialized_message_t * to, const rcl_serialized_message_t * message)
{
  if (to->buffer_capacity < to->buffer_length + message->buffer_length) {
    require(rmw_serialized_message_resize(to, to->buffer_length + message->buffer_length), "resize");
  }
  memcpy(to->buffer + to->buffer_length, message->buffer, message->buffer_length);
  to->buffer_length += message->buffer_length;
}

int main(int argc, char ** argv)
{
  const int is_held = argc > 1 && strcmp(argv[1], "held") == 0;
  const int is_joined = argc > 1 && strcmp(argv[1], "joined") == 0;
  argc -= is_held || is_joined;
  argv += is_held || is_joined;
  const size_t count = (size_t)(argc - 1) / 3;
  rcl_allocator_t allocator = rcl_get_default_allocator();
  rcl_init_options_t options = rcl_get_zero_initialized_init_options();
  require(rcl_init_options_init(&options, allocator), "init options");
  rcl_context_t context = rcl_get_zero_initialized_context();
  require(rcl_init(0, NULL, &options, &context), "init");
  signal(SIGTERM, end);
  rcl_node_options_t node_options = rcl_node_get_default_options();
  rcl_node_t node = rcl_get_zero_initialized_node();
  require(rcl_node_init(&node, "floor", "", &context, &node_options), "node");

  rcl_subscription_t * subscriptions = calloc(count, sizeof(*subscriptions));
  rcl_publisher_t * publishers = calloc(count, sizeof(*publishers));
  for (size_t i = 0; i < count; ++i) {
    char ** words = argv + 1 + 3 * i;
    rcl_subscription_options_t input = rcl_subscription_get_default_options();
    input.qos.depth = 100;
    subscriptions[i] = rcl_get_zero_initialized_subscription();
    require(rcl_subscription_init(&subscriptions[i], &node, type_of(words[0]), words[1], &input), words[1]);
    rcl_publisher_options_t output = rcl_publisher_get_default_options();
    output.qos.depth = 100;
    publishers[i] = rcl_get_zero_initialized_publisher();
    require(rcl_publisher_init(&publishers[i], &node, type_of(words[0]), words[2], &output), words[2]);
  }

  rcl_serialized_message_t * messages = calloc(count, sizeof(*messages));
  for (size_t i = 0; i < count; ++i) {
    messages[i] = rmw_get_zero_initialized_serialized_message();
    require(rmw_serialized_message_init(&messages[i], 0, &allocator), "message");
  }
  rcl_serialized_message_t whole = rmw_get_zero_initialized_serialized_message();
  require(rmw_serialized_message_init(&whole, 0, &allocator), "message");
  rcl_wait_set_t wait_set = rcl_get_zero_initialized_wait_set();
  require(rcl_wait_set_init(&wait_set, count, 0, 0, 0, 0, 0, &context, allocator), "wait set");
  while (!ended) {
    require(rcl_wait_set_clear(&wait_set), "clear");
    for (size_t i = 0; i < count; ++i) {
      require(rcl_wait_set_add_subscription(&wait_set, &subscriptions[i], NULL), "add");
    }
    if (rcl_wait(&wait_set, 100 * 1000 * 1000) == RCL_RET_TIMEOUT) {
      continue;
    }
    for (size_t i = 0; i < count; ++i) {
      rmw_message_info_t info;
      while (wait_set.subscriptions[i] &&
             rcl_take_serialized_message(&subscriptions[i], &messages[i], &info, NULL) == RCL_RET_OK) {
        if (is_joined) {
          append(&whole, &messages[i]);
          if (i == count - 1) {
            require(rcl_publish_serialized_message(&publishers[0], &whole, NULL), "publish");
            whole.buffer_length = 0;
          }
          continue;
        }
        for (size_t n = is_held ? 0 : i; n <= i && (!is_held || i == count - 1); ++n) {
          require(rcl_publish_serialized_message(&publishers[n], &messages[n], NULL), "publish");
        }
      }
    }
  }
  // The process ends with all that it holds; only the graph wants to hear of it.
  for (size_t i = 0; i < count; ++i) {
    require(rcl_subscription_fini(&subscriptions[i], &node), "subscription");
    require(rcl_publisher_fini(&publishers[i], &node), "publisher");
  }
  require(rcl_node_fini(&node), "node");
  return rcl_shutdown(&context) == RCL_RET_OK ? 0 : 1;
}
