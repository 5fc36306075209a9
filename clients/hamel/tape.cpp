#include "clients/hamel/tape.h"

#include <fmt/format.h>

#include <map>

#include "clients/hamel/unpacked.h"
#include "common/record/reader.h"

namespace hamel::client {

namespace {

class Loader {
 public:
  Loader(const TapeOptions& options) : options_(options) {}

  Checked<Tape> load() {
    auto reader = record::StreamReader::open(options_.path);
    if (!reader) return Problems{reader.error()};
    while (auto item = reader.value().next()) {
      if (const auto* d = std::get_if<record::Damage>(&*item))
        return Problems{{options_.path,
                         fmt::format("at byte {}: {}; a replay needs the whole of it", d->offset, d->what)}};
      if (const auto* c = std::get_if<record::Channel>(&*item)) topics_[c->id] = c->topic;
      if (const auto* a = std::get_if<record::Attachment>(&*item)) files_.add(*a);
      if (const auto* m = std::get_if<record::Metadata>(&*item); m && m->name == record::kRecovered)
        return Problems{
            {options_.path, "was recovered with messages missing in between; a replay needs all of them"}};
      if (const auto* m = std::get_if<record::Message>(&*item)) add(*m);
    }
    auto scene = load_scene(files_, options_.path, options_.scene_path, options_.overrides);
    if (!scene) return scene.error();
    tape_.scene = std::move(scene).value();
    keep(options_.arm != 0 ? options_.arm : tape_.scene->arm);
    if (tape_.states.empty()) return Problems{{options_.path, "holds no state of this arm"}};
    if (tape_.states.front().step != 0)
      return Problems{
          {options_.path, fmt::format("begins at step {}, not with the run: what the services remembered "
                                      "then is not in it",
                                      tape_.states.front().step)}};
    return std::move(tape_);
  }

 private:
  void add(const record::Message& m) {
    const std::string& name = topics_[m.channel];
    ++place_;
    if (name == topics::kState.name) {
      decode<wire::ArmState>(m, [this](const auto& s, Recorded r) {
        r.step = s.step, r.incarnation = s.incarnation, r.caused_by = s.caused_by;
        arms_[s.arm].states.push_back(std::move(r));
      });
    } else if (name == topics::kCommand.name) {
      decode<wire::TorqueCommand>(m, [this](const auto& c, Recorded r) {
        r.step = c.step, r.incarnation = c.state_incarnation, r.epoch = c.epoch, r.caused_by = c.caused_by;
        arms_[c.arm].commands.push_back(std::move(r));
      });
    } else if (name == topics::kReport.name) {
      decode<wire::PlannerReport>(m, [this](const auto& p, Recorded r) {
        r.step = p.step, r.epoch = p.epoch, r.caused_by = p.caused_by;
        if (p.caused_by.size > 0)
          arms_[p.arm].reports.push_back(std::move(r));  // others say that nothing was planned
      });
    } else if (name == topics::kObstacles.name) {
      decode<wire::ObstacleSet>(m, [this](const auto& o, Recorded r) {
        r.sequence = o.sequence_number;
        obstacles_.push_back(std::move(r));
      });
    } else if (name == topics::kGoal.name) {
      decode<wire::Goal>(m, [this](const auto& g, Recorded r) {
        r.sequence = g.id;
        arms_[g.arm].goals.push_back(std::move(r));
      });
    } else if (name == topics::kMode.name) {
      decode<wire::ModeCommand>(
          m, [this](const auto& c, Recorded r) { arms_[c.arm].modes.push_back(std::move(r)); });
    } else if (name == topics::kClock.name) {
      decode<wire::SimulationClock>(m, [this](const auto& c, const Recorded&) {
        arms_[c.arm].pace = c.pace == wire::Pace::lockstep ? scene::Pace::lockstep : scene::Pace::realtime;
      });
    } else if (name == topics::kSummary.name) {
      decode<wire::RunSummary>(m, [this](const auto& s, const Recorded&) {
        if (s.final_summary) arms_[s.arm].summary = s;
      });
    }
  }

  template <class T, class Use>
  void decode(const record::Message& m, Use&& use) {
    static T value;
    if (!wire::decode<T>(m.data, value)) return;
    Recorded r;
    r.topic = &wire::topic_of<T>();
    r.payload.assign(m.data.begin(), m.data.end());
    r.place = place_;
    use(value, std::move(r));
  }

  void keep(std::uint32_t arm) {
    Tape& t = arms_[arm];
    tape_.pace = t.pace;
    tape_.summary = t.summary;
    tape_.states = without_repeats(std::move(t.states));
    tape_.commands = without_repeats(std::move(t.commands));
    tape_.reports = without_repeats(std::move(t.reports));
    tape_.goals = std::move(t.goals);
    tape_.modes = std::move(t.modes);
    tape_.obstacles = std::move(obstacles_);
  }

  static std::vector<Recorded> without_repeats(std::vector<Recorded> all) {
    std::vector<Recorded> out;
    for (Recorded& r : all) {
      const bool repeat = !out.empty() && r.incarnation == out.back().incarnation &&
                          r.epoch == out.back().epoch && r.step <= out.back().step;
      if (!repeat) out.push_back(std::move(r));
    }
    return out;
  }

  const TapeOptions& options_;
  Unpacked files_;
  std::map<std::uint16_t, std::string> topics_;
  std::map<std::uint32_t, Tape> arms_;
  std::vector<Recorded> obstacles_;
  std::uint64_t place_ = 0;
  Tape tape_;
};

}  // namespace

Checked<Tape> load_tape(const TapeOptions& options) { return Loader(options).load(); }

}  // namespace hamel::client
