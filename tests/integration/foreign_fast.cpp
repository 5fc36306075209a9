#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <functional>
#include <limits>

#include "hamel_v1PubSubTypes.h"
#include "tests/integration/foreign.h"
#include "tests/support/loopback_fast.h"

namespace hamel::test {
namespace {

using namespace hamel::v1;
namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::types::ReturnCode_t;

constexpr double kInf = std::numeric_limits<double>::infinity();

std::vector<Cause> causes() {
  std::vector<Cause> c(2);
  c[0].service(2), c[0].number(101);
  c[1].service(3), c[1].number(102);
  return c;
}
void golden(ArmState& m) {
  m.arm(1), m.incarnation(2), m.step(3), m.t_s(4.5), m.dt_s(0.001);
  m.position({1.25, 1.25, 1.25}), m.velocity({2.25, 2.25, 2.25});
  m.momentum({3.25, 3.25, 3.25}), m.torque_applied({4.25, 4.25, 4.25});
  m.energy_J(5.5), m.work_J(6.5);
  m.solver().stop(STOP_STAGNATED), m.solver().iterations(7), m.solver().evaluations(8),
      m.solver().substeps(9);
  m.solver().residual_Nm(10.5);
  m.validity(VALID_HOLDING), m.torque_saturated(true), m.caused_by(causes());
}
void golden(TorqueCommand& m) {
  m.arm(1), m.epoch(2), m.state_incarnation(3), m.step(4), m.t_s(5.5), m.torque({6.25, 6.25});
  m.includes_gravity(true), m.planner_state(PLANNER_MOVING), m.caused_by(causes());
}
void golden(Goal& m) {
  m.arm(1), m.id(2), m.kind(GOAL_POSE), m.position_m({3.1, 3.2, 3.3}),
      m.orientation_xyzw({0.5, 0.5, -0.5, 0.5});
  m.twist({4.1, 4.2, 4.3, 4.4, 4.5, 4.6}), m.joints({5.25});
}
void golden(ObstacleSet& m) {
  m.source(1), m.incarnation(2), m.sequence_number(3), m.t_s(4.5), m.next_t_s(kInf);
  m.obstacles().resize(2);
  Obstacle& o = m.obstacles()[0];
  o.id(5), o.kind(SHAPE_CAPSULE), o.position_m({6.1, 6.2, 6.3}), o.orientation_xyzw({0.5, 0.5, 0.5, 0.5});
  o.dims_m({7.1, 7.2, 7.3}), o.twist({8.1, 8.2, 8.3, 8.4, 8.5, 8.6}), o.velocity_known(true), o.sigma_m(9.5);
  Obstacle& floor = m.obstacles()[1];
  floor.id(10), floor.kind(SHAPE_HALF_SPACE), floor.position_m({}), floor.orientation_xyzw({0, 0, 0, 1});
  floor.dims_m({}), floor.twist({}), floor.velocity_known(false), floor.sigma_m(0);
}
void golden(PlannerReport& m) {
  m.arm(1), m.epoch(2), m.step(3), m.t_s(4.5), m.state(PLANNER_STUCK), m.reason(REASON_GOAL_BLOCKED);
  m.detail("a wall"), m.method("gyro"), m.goal_id(5), m.mode_id(26), m.target_error_m(6.5),
      m.orientation_error_rad(7.5);
  m.speed_mps(8.5), m.end_effector_m({9.1, 9.2, 9.3}), m.clearance_m(10.5), m.clearance_min_m(11.5),
      m.contacts(12);
  m.path_length_m(13.5), m.time_to_goal_s(14.5), m.gyroscopic_power_W(15.5), m.injected_power_W(16.5);
  m.kinetic_J(20.5), m.attraction_J(21.5), m.tank_J(22.5), m.self_clearance_m(kInf);
  m.pairs_in_range(23), m.pairs_dropped(24), m.barrier_rows(25), m.velocities_estimated(26);
  m.velocities_unknown(27), m.escapes(28);
  m.obstacle_age_s(17.5), m.cycle_time_s(18.5), m.commands_late(19);
  m.links().resize(1);
  LinkReport& l = m.links()[0];
  l.link(1), l.obstacle_id(2), l.distance_m(kInf), l.point_on_link_m({4.1, 4.2, 4.3});
  l.point_on_obstacle_m({5.1, 5.2, 5.3}), l.closing_speed_mps(6.5), l.phi_rad(7.5), l.gate(0.5);
  l.gyroscopic_N({8.1, 8.2, 8.3}), l.repulsive_N({9.1, 9.2, 9.3}), l.barrier_multiplier(10.5);
  m.caused_by(causes());
}
void golden(ModeCommand& m) { m.arm(1), m.id(2), m.mode(MODE_RESUME); }
void golden(ServiceStatus& m) {
  m.instance(18), m.kind(SERVICE_PLANNER), m.arm(1), m.incarnation(3), m.version("0.1.0"), m.idl_hash("abc");
  m.bus("fastdds"), m.state(SERVICE_DEGRADED), m.detail("slow");
  m.counters().resize(2);
  m.counters()[0].name("late"), m.counters()[0].value(4);
  m.counters()[1].name("lost"), m.counters()[1].value(5);
}
void golden(RobotDescription& m) {
  m.arm(1), m.name("four_link"), m.urdf("<robot/>"), m.effort_limits({2.5, kInf});
}
void golden(SimulationClock& m) {
  m.arm(1), m.incarnation(2), m.step(3), m.t_s(4.5), m.dt_s(0.001), m.pace(PACE_REALTIME), m.running(true);
}
void golden(RunSummary& m) {
  m.arm(1), m.incarnation(2), m.steps(3), m.final_summary(true), m.outcome("done"), m.energy_drift_rel(4.5);
  m.iterations_mean(5.5), m.iterations_max(6), m.residual_max_Nm(7.5), m.substepped(8), m.commands_missed(9);
  m.deadlines_missed(10), m.trajectory_hash("0123abcd");
}

template <class T>
std::vector<std::byte> serialised(T& m, dds::TopicDataType& type) {
  rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&m)());
  std::fill_n(payload.data, payload.max_size,
              static_cast<rtps::octet>(0));  // Fast CDR leaves padding as it was
  if (!type.serialize(&m, &payload)) return {};
  const auto* bytes = reinterpret_cast<const std::byte*>(payload.data);
  return {bytes, bytes + payload.length};
}

template <class T, class PubSubType>
class FastPeer final : public ForeignPeer {
 public:
  FastPeer(const Topic& topic, unsigned domain) : participant_(loopback_participant(domain)) {
    const dds::TypeSupport type(new PubSubType);
    type.register_type(participant_);
    dds::DataWriterQos wqos;
    dds::DataReaderQos rqos;
    rqos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
    rqos.history().depth = 8;
    auto* publisher = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    auto* subscriber = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
    if (topic.delivery == Delivery::latched) wqos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
    wqos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    rqos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    auto* main =
        participant_->create_topic(std::string(topic.name), type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
    auto* echo = participant_->create_topic(std::string(kEcho), type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
    writer_ = publisher->create_datawriter(main, wqos);
    echo_ = publisher->create_datawriter(echo, wqos);
    reader_ = subscriber->create_datareader(main, rqos);
  }
  ~FastPeer() override {
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  bool matched() override {
    dds::PublicationMatchedStatus to, echoed;
    dds::SubscriptionMatchedStatus from;
    writer_->get_publication_matched_status(to);
    echo_->get_publication_matched_status(echoed);
    reader_->get_subscription_matched_status(from);
    return to.current_count >= 2 && echoed.current_count >= 1 && from.current_count >= 2;  // itself too
  }
  bool write_golden() override {
    T m;
    golden(m);
    return writer_->write(&m);
  }
  bool echo() override {
    T m;
    dds::SampleInfo info;
    while (reader_->take_next_sample(&m, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) return echo_->write(&m);
    return false;
  }

 private:
  dds::DomainParticipant* participant_;
  dds::DataWriter *writer_ = nullptr, *echo_ = nullptr;
  dds::DataReader* reader_ = nullptr;
};

/// What is done with the type of one topic.
struct Type {
  std::function<std::unique_ptr<ForeignPeer>(const Topic&, unsigned)> peer;
  std::function<std::vector<std::byte>()> golden;
  std::function<std::vector<std::byte>(std::span<const std::byte>)> again;
};

template <class T, class PubSubType>
Type type_of() {
  Type t;
  t.peer = [](const Topic& topic, unsigned domain) {
    return std::make_unique<FastPeer<T, PubSubType>>(topic, domain);
  };
  t.golden = [] {
    PubSubType type;
    auto m = std::make_unique<T>();
    golden(*m);
    return serialised(*m, type);
  };
  t.again = [](std::span<const std::byte> bytes) {
    PubSubType type;
    auto m = std::make_unique<T>();
    rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
    std::memcpy(payload.data, bytes.data(), bytes.size());
    payload.length = static_cast<std::uint32_t>(bytes.size());
    return type.deserialize(&payload, m.get()) ? serialised(*m, type) : std::vector<std::byte>();
  };
  return t;
}

const Type& type_of(const Topic& topic) {
  static const std::vector<Type> types{type_of<ArmState, ArmStatePubSubType>(),
                                       type_of<TorqueCommand, TorqueCommandPubSubType>(),
                                       type_of<Goal, GoalPubSubType>(),
                                       type_of<ObstacleSet, ObstacleSetPubSubType>(),
                                       type_of<PlannerReport, PlannerReportPubSubType>(),
                                       type_of<ModeCommand, ModeCommandPubSubType>(),
                                       type_of<ServiceStatus, ServiceStatusPubSubType>(),
                                       type_of<RobotDescription, RobotDescriptionPubSubType>(),
                                       type_of<SimulationClock, SimulationClockPubSubType>(),
                                       type_of<RunSummary, RunSummaryPubSubType>()};
  for (std::size_t i = 0; i < kTopics.size(); ++i)
    if (kTopics[i].name == topic.name) return types.at(i);
  throw std::logic_error("no such topic");
}

}  // namespace

std::unique_ptr<ForeignPeer> fast_peer(const Topic& topic, unsigned domain) {
  return type_of(topic).peer(topic, domain);
}
std::vector<std::byte> fast_golden(const Topic& topic) { return type_of(topic).golden(); }
std::vector<std::byte> fast_again(const Topic& topic, std::span<const std::byte> payload) {
  return type_of(topic).again(payload);
}

}  // namespace hamel::test
