#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "dds/dds.h"
#include "hamel_v1.h"
#include "tests/integration/foreign.h"

namespace hamel::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

/// The whole of an array as one of idlc's sequences.
template <class Sequence, class Item, std::size_t N>
void set(Sequence& s, Item (&items)[N]) {
  s = {N, N, items, false};
}
template <std::size_t N>
void set(double (&to)[N], const double (&from)[N]) {
  std::copy_n(from, N, to);
}

hamel_v1_Cause causes[] = {{2, 101}, {3, 102}};
double ones[] = {1.25, 1.25, 1.25}, twos[] = {2.25, 2.25, 2.25}, threes[] = {3.25, 3.25, 3.25};
double fours[] = {4.25, 4.25, 4.25}, sixes[] = {6.25, 6.25}, five[] = {5.25}, limits[] = {2.5, kInf};
hamel_v1_Obstacle obstacles[2];
hamel_v1_LinkReport links[1];
hamel_v1_Counter counters[2];

void golden(hamel_v1_ArmState& m) {
  m.arm = 1, m.incarnation = 2, m.step = 3, m.t_s = 4.5, m.dt_s = 0.001;
  set(m.position, ones), set(m.velocity, twos), set(m.momentum, threes), set(m.torque_applied, fours);
  m.energy_J = 5.5, m.work_J = 6.5;
  m.solver = {hamel_v1_STOP_STAGNATED, 7, 8, 9, 10.5};
  m.validity = hamel_v1_VALID_HOLDING, m.torque_saturated = true;
  set(m.caused_by, causes);
}
void golden(hamel_v1_TorqueCommand& m) {
  m.arm = 1, m.epoch = 2, m.state_incarnation = 3, m.step = 4, m.t_s = 5.5;
  set(m.torque, sixes), set(m.caused_by, causes);
  m.includes_gravity = true, m.planner_state = hamel_v1_PLANNER_MOVING;
}
void golden(hamel_v1_Goal& m) {
  m.arm = 1, m.id = 2, m.kind = hamel_v1_GOAL_POSE;
  set(m.position_m, {3.1, 3.2, 3.3}), set(m.orientation_xyzw, {0.5, 0.5, -0.5, 0.5});
  set(m.twist, {4.1, 4.2, 4.3, 4.4, 4.5, 4.6});
  set(m.joints, five);
}
void golden(hamel_v1_ObstacleSet& m) {
  m.source = 1, m.incarnation = 2, m.sequence_number = 3, m.t_s = 4.5, m.next_t_s = kInf;
  auto& o = obstacles[0];
  o.id = 5, o.kind = hamel_v1_SHAPE_CAPSULE, o.velocity_known = true, o.sigma_m = 9.5;
  set(o.position_m, {6.1, 6.2, 6.3}), set(o.orientation_xyzw, {0.5, 0.5, 0.5, 0.5}),
      set(o.dims_m, {7.1, 7.2, 7.3});
  set(o.twist, {8.1, 8.2, 8.3, 8.4, 8.5, 8.6});
  obstacles[1] = {};
  obstacles[1].id = 10, obstacles[1].kind = hamel_v1_SHAPE_HALF_SPACE, obstacles[1].orientation_xyzw[3] = 1;
  set(m.obstacles, obstacles);
}
void golden(hamel_v1_PlannerReport& m) {
  m.arm = 1, m.epoch = 2, m.step = 3, m.t_s = 4.5;
  m.state = hamel_v1_PLANNER_STUCK, m.reason = hamel_v1_REASON_GOAL_BLOCKED;
  std::strcpy(m.detail, "a wall"), std::strcpy(m.method, "gyro");
  m.goal_id = 5, m.mode_id = 26, m.target_error_m = 6.5, m.orientation_error_rad = 7.5, m.speed_mps = 8.5;
  set(m.end_effector_m, {9.1, 9.2, 9.3});
  m.clearance_m = 10.5, m.clearance_min_m = 11.5, m.contacts = 12, m.path_length_m = 13.5,
  m.time_to_goal_s = 14.5;
  m.gyroscopic_power_W = 15.5, m.injected_power_W = 16.5;
  m.kinetic_J = 20.5, m.attraction_J = 21.5, m.tank_J = 22.5, m.self_clearance_m = kInf;
  m.pairs_in_range = 23, m.pairs_dropped = 24, m.barrier_rows = 25, m.velocities_estimated = 26;
  m.velocities_unknown = 27, m.escapes = 28;
  m.obstacle_age_s = 17.5, m.cycle_time_s = 18.5;
  m.commands_late = 19;
  auto& l = links[0];
  l.link = 1, l.obstacle_id = 2, l.distance_m = kInf, l.closing_speed_mps = 6.5, l.phi_rad = 7.5,
  l.gate = 0.5;
  set(l.point_on_link_m, {4.1, 4.2, 4.3}), set(l.point_on_obstacle_m, {5.1, 5.2, 5.3});
  set(l.gyroscopic_N, {8.1, 8.2, 8.3}), set(l.repulsive_N, {9.1, 9.2, 9.3});
  l.barrier_multiplier = 10.5;
  set(m.links, links), set(m.caused_by, causes);
}
void golden(hamel_v1_ModeCommand& m) { m = {1, 2, hamel_v1_MODE_RESUME}; }
void golden(hamel_v1_ServiceStatus& m) {
  m.instance = 18, m.kind = hamel_v1_SERVICE_PLANNER, m.arm = 1, m.incarnation = 3;
  std::strcpy(m.version, "0.1.0"), std::strcpy(m.idl_hash, "abc"), std::strcpy(m.bus, "fastdds");
  m.state = hamel_v1_SERVICE_DEGRADED;
  std::strcpy(m.detail, "slow");
  std::strcpy(counters[0].name, "late"), std::strcpy(counters[1].name, "lost");
  counters[0].value = 4, counters[1].value = 5;
  set(m.counters, counters);
}
void golden(hamel_v1_RobotDescription& m) {
  m.arm = 1;
  std::strcpy(m.name, "four_link"), std::strcpy(m.urdf, "<robot/>");
  set(m.effort_limits, limits);
}
void golden(hamel_v1_SimulationClock& m) { m = {1, 2, 3, 4.5, 0.001, hamel_v1_PACE_REALTIME, true}; }
void golden(hamel_v1_RunSummary& m) {
  m.arm = 1, m.incarnation = 2, m.steps = 3, m.final_summary = true;
  std::strcpy(m.outcome, "done"), std::strcpy(m.trajectory_hash, "0123abcd");
  m.energy_drift_rel = 4.5, m.iterations_mean = 5.5, m.iterations_max = 6, m.residual_max_Nm = 7.5;
  m.substepped = 8, m.commands_missed = 9, m.deadlines_missed = 10;
}

constexpr const char* kLoopback =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer Address=\"127.0.0.1\"/></Peers></Discovery></Domain></CycloneDDS>";

template <class T>
class CyclonePeer final : public ForeignPeer {
 public:
  CyclonePeer(const Topic& topic, unsigned domain, const dds_topic_descriptor_t& descriptor)
      : domain_(dds_create_domain(domain, kLoopback)),
        participant_(dds_create_participant(domain, nullptr, nullptr)) {
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 8);
    const auto main =
        dds_create_topic(participant_, &descriptor, std::string(topic.name).c_str(), nullptr, nullptr);
    const auto echo =
        dds_create_topic(participant_, &descriptor, std::string(kEcho).c_str(), nullptr, nullptr);
    reader_ = dds_create_reader(participant_, main, qos, nullptr);
    if (topic.delivery == Delivery::latched) dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
    writer_ = dds_create_writer(participant_, main, qos, nullptr);
    echo_ = dds_create_writer(participant_, echo, qos, nullptr);
    dds_delete_qos(qos);
  }
  ~CyclonePeer() override { dds_delete(domain_); }

  bool matched() override {
    dds_publication_matched_status_t to, echoed;
    dds_subscription_matched_status_t from;
    dds_get_publication_matched_status(writer_, &to);
    dds_get_publication_matched_status(echo_, &echoed);
    dds_get_subscription_matched_status(reader_, &from);
    return to.current_count >= 2 && echoed.current_count >= 1 && from.current_count >= 2;  // itself too
  }
  bool write_golden() override {
    auto m = std::make_unique<T>();
    std::memset(m.get(), 0, sizeof(T));
    golden(*m);
    return dds_write(writer_, m.get()) == DDS_RETCODE_OK;
  }
  bool echo() override {
    void* samples[1] = {nullptr};
    dds_sample_info_t info;
    bool written = false;
    while (!written && dds_take(reader_, samples, &info, 1, 1) == 1) {
      written = info.valid_data && dds_write(echo_, samples[0]) == DDS_RETCODE_OK;
      dds_return_loan(reader_, samples, 1);
    }
    return written;
  }

 private:
  dds_entity_t domain_, participant_, writer_ = 0, echo_ = 0, reader_ = 0;
};

}  // namespace

std::unique_ptr<ForeignPeer> cyclone_peer(const Topic& topic, unsigned domain) {
#define HAMEL_PEER(T)                 \
  if (topic.type == "hamel::v1::" #T) \
  return std::make_unique<CyclonePeer<hamel_v1_##T>>(topic, domain, hamel_v1_##T##_desc)
  HAMEL_PEER(ArmState);
  HAMEL_PEER(TorqueCommand);
  HAMEL_PEER(Goal);
  HAMEL_PEER(ObstacleSet);
  HAMEL_PEER(PlannerReport);
  HAMEL_PEER(ModeCommand);
  HAMEL_PEER(ServiceStatus);
  HAMEL_PEER(RobotDescription);
  HAMEL_PEER(SimulationClock);
  HAMEL_PEER(RunSummary);
#undef HAMEL_PEER
  throw std::logic_error("no such topic");
}

}  // namespace hamel::test
