#pragma once
/// Watches a run on the wire and tells how it went: a live line, a row per step, an outcome at the end.

#include <fmt/format.h>

#include <cstdio>
#include <deque>
#include <iterator>
#include <memory>
#include <optional>
#include <string>

#include "common/rbd/rbd.h"
#include "common/runtime/loop.h"
#include "common/scene/scene.h"
#include "common/wire/endpoint.h"

namespace hamel::client {

/// A run in numbers; every double may be +inf or NaN where nothing was measured.
struct Outcome {
  std::string outcome;  ///< DONE, REACHED, STUCK, UNSAFE, FAULT, MOVING, NO_DATA, INTERRUPTED
  std::string reason, detail;
  int exit_code = 0;
  double time_to_goal_s = -1;  ///< < 0: not reached
  double final_error_m = 0, min_clearance_m = 0, path_length_m = 0;
  std::uint32_t contacts = 0;
  wire::RunSummary summary;
  double t_s = 0, wall_s = 0;
  std::uint64_t rows_lost = 0;  ///< states the monitor did not see
  int restarts = 0;
  struct Outage {
    const char* service = "";
    double t_s = 0;       ///< the run's time when it was noticed
    double length_s = 0;  ///< dynamics: of wall time; the others: of the run's
  };
  std::vector<Outage> outages;  ///< real time: in their order; the first kMostOutages
  std::uint64_t outages_more = 0;
};

class CsvWriter {
 public:
  /// Fails with the reason where the file cannot be written.  `steered`: with the planner's columns.
  static Result<std::unique_ptr<CsvWriter>, Problem> open(const std::string& path, int n, bool steered);
  ~CsvWriter();
  CsvWriter(const CsvWriter&) = delete;
  CsvWriter& operator=(const CsvWriter&) = delete;
  void row(const wire::ArmState& s, const Eigen::Vector3d& tip_m, const wire::PlannerReport& r);
  /// Flushes; the problem where anything could not be written (a full disk).
  std::optional<Problem> finish();

 private:
  CsvWriter() = default;
  void report(const wire::PlannerReport& r, std::back_insert_iterator<fmt::memory_buffer> out) const;
  std::FILE* file_ = nullptr;
  std::string path_;
  bool failed_ = false;
  int links_ = 0;  ///< with columns of their own
};

/// Of several writers that speak for one arm (two networks on one domain), the one that is heard: the first,
/// until it has been silent for a while.
class Heard {
 public:
  /// Whether what `from` wrote counts.  `continues`: it goes on where the one that was heard stopped.
  bool takes(const bus::WriterId& from, runtime::Clock::time_point now, bool continues = false);
  /// All that waited has been taken: where nothing of the one that is heard was among it for long, another
  /// takes its place.
  void settle(runtime::Clock::time_point now);

 private:
  std::optional<bus::WriterId> writer_, other_;
  runtime::Clock::time_point last_{};
};

class Monitor final : public runtime::Service {
 public:
  /// `live`: a status line on stderr.  `csv` may be null.
  Monitor(bus::Node& node, const scene::Scene& scene, scene::Pace pace, std::unique_ptr<CsvWriter> csv,
          bool live);
  bool poll(runtime::Clock::time_point now) override;
  runtime::Clock::time_point due() const override;
  /// The run is over and its last report is here, or nothing was heard for `patience`.
  bool finished() const override { return finished_; }

  Outcome outcome(bool interrupted);
  std::optional<Problem> finish_csv() { return csv_ ? csv_->finish() : std::nullopt; }
  /// Set by the supervisor: shown in the live line.
  void restarts(int n) { restarts_ = n; }

 private:
  using Time = runtime::Clock::time_point;
  void take_states(Time now);
  void take_reports(Time now);
  void take_summaries(Time now);
  void follow(const wire::ArmState& s, Time now);
  void begin_anew();
  void outage(const char* service, double t_s, double length_s);
  void write_rows(bool all);
  void show(Time now);

  const scene::Scene& scene_;
  const scene::Pace pace_;
  wire::Subscription<wire::ArmState> state_in_;
  wire::Subscription<wire::PlannerReport> report_in_;
  wire::Subscription<wire::RunSummary> summary_in_;
  std::unique_ptr<CsvWriter> csv_;
  const bool live_;
  rbd::Workspace ws_;

  Heard arm_, planner_;
  std::optional<wire::ArmState> state_;
  std::optional<wire::PlannerReport> report_;
  std::optional<wire::RunSummary> summary_;
  double clearance_min_m_ = wire::kInf;
  std::uint32_t contacts_ = 0;
  std::deque<wire::ArmState> rows_;
  std::uint64_t rows_lost_ = 0;
  int restarts_ = 0;
  std::vector<Outcome::Outage> outages_;
  std::uint64_t outages_more_ = 0;
  std::optional<double> silent_since_s_, blind_since_s_;  ///< the planner; its obstacles
  Time last_state_{};
  Time began_{}, last_heard_{}, final_heard_{}, last_shown_{}, ended_{};
  double shown_t_s_ = 0;
  std::uint64_t states_ = 0, reports_ = 0, shown_states_ = 0;
  bool finished_ = false;
};

}  // namespace hamel::client
