#include "services/perception/core/source.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/lie/so3.h"
#include "services/perception/core/flaws.h"

namespace hamel::perception {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kOnGrid = 1e-6;  // of a period: so near a grid point counts as on it

bool moves(const scene::ScriptedObstacle& o) { return !o.velocity_mps.isZero(0) || !o.amplitude_m.isZero(0); }

geometry::Obstacle scripted_at(const scene::ScriptedObstacle& o, double t_s) {
  geometry::Obstacle out = o.at_start;
  const double omega = 2 * std::numbers::pi * o.frequency_hz;
  const double angle = omega * t_s + o.phase_rad;
  out.X_WO.p += o.velocity_mps * t_s + o.amplitude_m * std::sin(angle);
  out.V_WO.head<3>().setZero();
  out.V_WO.tail<3>() = o.velocity_mps + o.amplitude_m * (omega * std::cos(angle));
  out.velocity_known = true;
  return out;
}

}  // namespace

Checked<Source> Source::make(const scene::PerceptionOptions& options) {
  Problems found = scene::problems(options);
  if (!found.empty()) return found;
  return Source(options);
}

Source::Source(const scene::PerceptionOptions& options)
    : scripted_(options.obstacles), flaws_(options.flaws), rate_hz_(options.rate_hz) {
  moves_ = std::any_of(scripted_.begin(), scripted_.end(), moves);
  if (flaws_) moves_ |= !scripted_.empty() && (flaws_->noise_m > 0 || flaws_->dropout > 0);
  if (options.stream) {
    stream_ = *options.stream;
    rate_hz_ = std::max(rate_hz_, kLeastStreamRate_hz);
    make_frames();
    find_glitches();
  }
  most_ += scripted_.size();
}

void Source::make_frames() {
  auto& samples = stream_.samples;
  std::erase_if(samples, [this](const auto& s) { return s.t_s > stream_.until_s; });
  std::stable_sort(samples.begin(), samples.end(),
                   [](const auto& a, const auto& b) { return a.t_s != b.t_s ? a.t_s < b.t_s : a.id < b.id; });
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (frames_.empty() || samples[i].t_s > frames_.back().t_s) frames_.push_back({samples[i].t_s, i, i});
    frames_.back().end = i + 1;
    most_ = std::max(most_, frames_.back().end - frames_.back().begin);
  }
  for (const double t_s : stream_.empty_s)
    if (t_s <= stream_.until_s) frames_.push_back({t_s, 0, 0});
  std::stable_sort(frames_.begin(), frames_.end(),
                   [](const Frame& a, const Frame& b) { return a.t_s < b.t_s; });
  const std::size_t last = frames_.size() - 1;
  const bool steady = last > 0 && !is_gap(last - 1);
  const double interval_s = steady ? frames_[last].t_s - frames_[last - 1].t_s : stream_.rate / rate_hz_;
  end_s_ = frames_[last].t_s + interval_s;
}

double Source::speed_mps(const scene::StreamSample& a, const scene::StreamSample& b) const {
  return stream_.scale * (b.p_m - a.p_m).norm() / (b.t_s - a.t_s);
}

/// A sample that is far from both its neighbours, which are near each other.
void Source::find_glitches() {
  for (std::size_t k = 1; k + 1 < frames_.size(); ++k) {
    for (std::size_t i = frames_[k].begin; i < frames_[k].end; ++i) {
      scene::StreamSample& here = stream_.samples[i];
      const auto *before = find(k - 1, here.id), *next = find(k + 1, here.id);
      if (before == nullptr || next == nullptr || is_gap(k - 1) || is_gap(k)) continue;
      const double most = stream_.glitch_mps;
      if (speed_mps(*before, here) <= most || speed_mps(here, *next) <= most ||
          speed_mps(*before, *next) > most)
        continue;
      glitch_s_.push_back(here.t_s);
      if (stream_.causal) continue;
      here.p_m =
          before->p_m + (next->p_m - before->p_m) * ((here.t_s - before->t_s) / (next->t_s - before->t_s));
    }
  }
}

std::size_t Source::glitches(double t_s) const {
  if (frames_.empty()) return 0;
  const auto until = [this](double s) {
    return static_cast<std::size_t>(std::upper_bound(glitch_s_.begin(), glitch_s_.end(), s) -
                                    glitch_s_.begin());
  };
  const double s = stream_.start_s + stream_.rate * seen(t_s), first = frames_.front().t_s;
  const double laps = stream_.loop && s >= end_s_ ? std::floor((s - first) / (end_s_ - first)) : 0;
  const auto passed = static_cast<std::size_t>(laps) * glitch_s_.size();
  return passed + until(stream_time(t_s)) - until(stream_.start_s);
}

/// The time that a set with this stamp shows.
double Source::seen(double t_s) const { return flaws_ ? std::max(0.0, t_s - flaws_->latency_s) : t_s; }

double Source::stream_time(double t_s) const {
  const double s = stream_.start_s + stream_.rate * seen(t_s);
  const double first = frames_.front().t_s;
  if (!stream_.loop || s < end_s_) return s;
  return first + std::fmod(s - first, end_s_ - first);
}

/// The last frame that is not behind; there is one.
std::size_t Source::frame_at(double stream_t_s) const {
  const auto after = std::upper_bound(frames_.begin(), frames_.end(), stream_t_s,
                                      [](double t, const Frame& f) { return t < f.t_s; });
  return static_cast<std::size_t>(after - frames_.begin()) - 1;
}

bool Source::is_gap(std::size_t frame) const {
  return frame + 1 < frames_.size() &&
         frames_[frame + 1].t_s - frames_[frame].t_s > kLongestSilence_s * stream_.rate;
}

bool Source::in_gap(double stream_t_s, double& gap_end_s) const {
  if (frames_.empty() || stream_t_s < frames_.front().t_s) return false;
  const std::size_t k = frame_at(stream_t_s);
  if (!is_gap(k) || stream_t_s == frames_[k].t_s) return false;
  gap_end_s = frames_[k + 1].t_s;
  return true;
}

const scene::StreamSample* Source::find(std::size_t frame, std::uint32_t id) const {
  const auto begin = stream_.samples.begin() + static_cast<std::ptrdiff_t>(frames_[frame].begin);
  const auto end = stream_.samples.begin() + static_cast<std::ptrdiff_t>(frames_[frame].end);
  const auto at =
      std::lower_bound(begin, end, id, [](const auto& s, std::uint32_t wanted) { return s.id < wanted; });
  return at != end && at->id == id ? &*at : nullptr;
}

/// The frame that follows, where one does.
std::size_t Source::after(std::size_t frame) const {
  return frame + 1 == frames_.size() && stream_.loop ? 0 : frame + 1;
}

double Source::span_s(std::size_t frame) const {
  return (frame + 1 < frames_.size() ? frames_[frame + 1].t_s : end_s_) - frames_[frame].t_s;
}

/// The velocity of an obstacle from one frame to the next, in stream lengths per stream second; none where it
/// is not in both, or nothing is known between them.
std::optional<lie::Twist> Source::velocity(std::size_t frame, std::uint32_t id) const {
  if (frame >= frames_.size() || after(frame) >= frames_.size() || is_gap(frame)) return {};
  const auto *here = find(frame, id), *next = find(after(frame), id);
  if (here == nullptr || next == nullptr) return {};
  lie::Twist v = lie::Twist::Zero();
  if (here->R_SO != next->R_SO)
    v.head<3>() = lie::log_so3(next->R_SO * here->R_SO.transpose()) / span_s(frame);
  v.tail<3>() = (next->p_m - here->p_m) / span_s(frame);
  return v;
}

/// One obstacle of the stream: on the line to its next place, else on the line from its last one, else
/// standing.  A line that is too fast has a wrong sample at one end: the velocity is then that of the line
/// before, or behind.
geometry::Obstacle Source::place(std::size_t frame, const scene::StreamSample& sample,
                                 double stream_t_s) const {
  geometry::Obstacle out;
  out.id = sample.id;
  out.shape = sample.shape;
  out.sigma_m = sample.sigma_m * stream_.scale;
  const double since_s = stream_t_s - frames_[frame].t_s;
  const auto now = stream_.causal ? std::nullopt : velocity(frame, sample.id);
  const auto before = frame > 0 ? velocity(frame - 1, sample.id) : std::nullopt;
  if (now) {
    const geometry::Shape& next = find(after(frame), sample.id)->shape;
    if (next.kind == sample.shape.kind)
      out.shape.dims_m += (next.dims_m - sample.shape.dims_m) * (since_s / span_s(frame));
  }
  const lie::Twist V_S = now ? *now : before.value_or(lie::Twist::Zero());
  out.velocity_known = false;
  const auto behind = stream_.causal ? std::nullopt : velocity(frame + 1, sample.id);
  for (const auto& v : {now, before, behind}) {
    if (out.velocity_known || !v || v->tail<3>().norm() * stream_.scale > stream_.glitch_mps ||
        !(now || before))
      continue;
    out.velocity_known = true;
    out.V_WO.head<3>() = stream_.X_WS.R * v->head<3>() * stream_.rate;
    out.V_WO.tail<3>() = stream_.X_WS.R * v->tail<3>() * (stream_.scale * stream_.rate);
  }
  out.shape.dims_m *= stream_.scale;
  out.X_WO.p = stream_.X_WS * Eigen::Vector3d(stream_.scale * (sample.p_m + V_S.tail<3>() * since_s));
  if (sample.shape.kind == geometry::ShapeKind::sphere) return out;  // its frame means nothing
  out.X_WO.R = stream_.X_WS.R * lie::exp_so3(V_S.head<3>() * since_s) * sample.R_SO;
  return out;
}

bool Source::at(double t_s, std::vector<geometry::Obstacle>& out) const {
  out.clear();
  double gap_end_s = 0;
  const double s = frames_.empty() ? 0 : stream_time(t_s);
  if (in_gap(s, gap_end_s)) return false;
  for (const scene::ScriptedObstacle& o : scripted_) out.push_back(scripted_at(o, seen(t_s)));
  if (!frames_.empty() && s >= frames_.front().t_s && s < end_s_) {
    const std::size_t k = frame_at(s);
    for (std::size_t i = frames_[k].begin; i < frames_[k].end; ++i)
      out.push_back(place(k, stream_.samples[i], s));
  }
  if (flaws_) apply(*flaws_, static_cast<std::uint64_t>(std::llround(std::max(0.0, t_s) * rate_hz_)), out);
  return true;
}

/// The first grid point behind t_s.
double Source::grid_after(double t_s) const {
  return (std::floor(t_s * rate_hz_ + kOnGrid) + 1) * period_s();
}

double Source::next_time(double t_s) const {
  if (is_static()) return kInf;
  const bool over = frames_.empty() || (!stream_.loop && stream_time(t_s) >= end_s_);
  if (over && !moves_) return kInf;
  double next = grid_after(t_s);
  double gap_end_s = 0;
  while (!frames_.empty() && in_gap(stream_time(next), gap_end_s)) {
    const double left_s = (gap_end_s - stream_time(next)) / stream_.rate;
    next = grid_after(next + std::max(left_s - period_s(), 0.0));
  }
  return next;
}

}  // namespace hamel::perception
