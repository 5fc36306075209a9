#include "clients/hamel/network_verbs.h"

namespace hamel::client {

NetworkVerbs::NetworkVerbs(CLI::App& app) {
  doctor_ = app.add_subcommand("doctor", "look for what stands in the way on this machine and network");
  doctor_->add_flag("--json", doctor_args_.json, "one JSON object");
  runtime::add_bus_options(*doctor_, doctor_args_.bus);

  topic_ = app.add_subcommand("topic", "what travels on the bus");
  topic_->require_subcommand(1);
  list_ = add_topic("list", "every topic, who writes and reads it, with what QoS", false);
  echo_ = add_topic("echo", "every message of a topic", true);
  echo_->get_option("topic")->required();
  echo_->add_option("--count", topic_args_.count, "end after so many")->type_name("N");
  hz_ = add_topic("hz", "rates, gaps, losses and broken promises, of one topic or all", true);
  latency_ = add_topic("latency", "from an arm's state to the command that answers it", false);
  for (auto* verb : {echo_, latency_}) verb->add_option("--arm", topic_args_.arm, "of this arm only");
  add_bench(app);
}

void NetworkVerbs::add_bench(CLI::App& app) {
  const auto is_bench = [](CLI::App* a) { return a->get_name() == "bench"; };
  const auto there = app.get_subcommands(is_bench);
  CLI::App* bench = there.empty() ? app.add_subcommand("bench", "measure") : there[0];
  bench->require_subcommand(1);
  bench_bus_ = bench->add_subcommand("bus", "what the bus costs, beside bare UDP in the same run");
  bench_bus_->add_option("--samples", bench_args_.samples, "of each pair")
      ->check(CLI::Range(1, 10000000))
      ->capture_default_str();
  bench_bus_->add_option("--rate", bench_args_.rate_hz, "questions a second; 0: one after the other")
      ->check(runtime::between(0, 1e6))
      ->capture_default_str();
  bench_bus_->add_option("--domain", bench_args_.domain, "DDS domain")->capture_default_str();
  bench_bus_->add_option("--only", bench_args_.only, "this part")
      ->check(CLI::IsMember({"latency", "restart", "loop", "lockstep"}));
  bench_bus_->add_option("--cpu", bench_args_.cpu, "everything on this processor");
  bench_bus_->add_flag("--json", bench_args_.json, "one JSON object");
  bench_bus_->add_flag("--assert", bench_args_.check,
                       "exit code 1 where a sample is lost, a restart takes long or lockstep is slow");
  bench_bus_->add_option("--answer", bench_args_.answer)->group("");
}

CLI::App* NetworkVerbs::add_topic(const char* name, const char* help, bool named) {
  auto* verb = topic_->add_subcommand(name, help);
  if (named) verb->add_option("topic", topic_args_.topic, "state, command, obstacles, report, ...");
  verb->add_option("--seconds", topic_args_.seconds, "how long to listen; echo: to wait for the first")
      ->capture_default_str()
      ->check(runtime::positive());
  verb->add_flag("--json", topic_args_.json, "for machines");
  runtime::add_bus_options(*verb, topic_args_.bus);
  return verb;
}

std::optional<int> NetworkVerbs::run() const {
  if (doctor_->parsed()) return doctor(doctor_args_);
  if (list_->parsed()) return topic_list(topic_args_);
  if (echo_->parsed()) return topic_echo(topic_args_);
  if (hz_->parsed()) return topic_hz(topic_args_);
  if (latency_->parsed()) return topic_latency(topic_args_);
  if (bench_bus_->parsed()) return bench_bus(bench_args_);
  return {};
}

}  // namespace hamel::client
