#pragma once
/// `hamel topic`: what travels on the bus.

#include "common/runtime/options.h"

namespace hamel::client {

struct TopicArgs {
  runtime::BusOptions bus;
  std::string topic;        ///< "state", or the whole name
  double seconds = 3;       ///< how long to listen
  std::uint64_t count = 0;  ///< echo: end after so many; 0: until Ctrl-C
  std::optional<std::uint32_t> arm;
  bool json = false;
};

/// Every topic with its writers and readers, and what their QoS is.
int topic_list(const TopicArgs& args);
/// Every message of a topic, a line a field.
int topic_echo(const TopicArgs& args);
/// Rate, longest gap, loss, broken promises; of one topic or all.
int topic_hz(const TopicArgs& args);
/// From a state to the command that answers it, as they pass here.
int topic_latency(const TopicArgs& args);

}  // namespace hamel::client
