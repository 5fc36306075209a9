#include "common/wire/fields.h"

#include <bit>

#include "common/wire/layout.h"

namespace hamel::wire {
namespace {

/// A cdr::Reader that notes what it reads, before any normalisation.
class Lister : public cdr::Reader {
 public:
  Lister(std::span<const std::byte> payload, std::vector<Field>& out) : Reader(payload), out_(out) {}

  template <class U>
  void integer(const char* field, U& v) {
    Reader::integer(field, v);
    note(field, std::uint64_t{v});
  }
  void boolean(const char* field, bool& v) {
    Reader::boolean(field, v);
    note(field, v);
  }
  template <class E>
  void enumeration(const char* field, E& v, E last) {
    Reader::enumeration(field, v, last);
    note(field, static_cast<std::uint64_t>(v));
  }
  void real(const char* field, double& v, cdr::Real kind = cdr::Real::finite) {
    Reader::real(field, v, kind);
    note(field, v);
  }
  template <class V>
  void reals(const char* field, V& v, cdr::Real kind = cdr::Real::finite) {
    Reader::reals(field, v, kind);
    for (Eigen::Index i = 0; i < v.size(); ++i) note(field, v[i], i);
  }
  void text(const char* field, std::string& s, std::size_t bound) {
    Reader::text(field, s, bound);
    note(field, s);
  }
  template <class T, class Each>
  void list(const char* field, std::vector<T>& v, std::size_t bound, std::size_t item_bytes, Each&& each) {
    v.resize(count(field, bound, item_bytes));
    items(field, v, v.size(), each);
  }
  template <class T, std::size_t N, class Each>
  void list(const char* field, std::array<T, N>& v, std::size_t& n, std::size_t item_bytes, Each&& each) {
    n = count(field, N, item_bytes);
    items(field, v, n, each);
  }
  void joints(const char* field, JointVector& v, cdr::Real kind = cdr::Real::finite) {
    Reader::joints(field, v, kind);
    if (v.size() == 0) note(field, EmptyList{});
    for (Eigen::Index i = 0; i < v.size(); ++i) note(field, v[i], i);
  }

 private:
  /// The fields of a list's items are named "list.field": the list's name and index replace the first part.
  template <class Vs, class Each>
  void items(const char* field, Vs& v, std::size_t n, Each& each) {
    if (n == 0) note(field, EmptyList{});
    for (std::size_t i = 0; ok() && i < n; ++i) {
      item_ = std::string(field) + "[" + std::to_string(i) + "]";
      each(*this, v[i]);
    }
    item_.clear();
  }
  template <class V>
  void note(const char* field, V value, Eigen::Index index = -1) {
    if (!ok()) return;
    std::string path = field;
    if (!item_.empty()) path = item_ + path.substr(path.find('.'));
    if (index >= 0) path += "[" + std::to_string(index) + "]";
    out_.push_back({std::move(path), value});
  }

  std::vector<Field>& out_;
  std::string item_;  ///< of the list that is being read
};

template <class T>
Result<std::vector<Field>, DecodeError> list(std::span<const std::byte> payload) {
  if (payload.size() > topic_of<T>().max_bytes)
    return DecodeError{"payload", "must not be larger than its topic allows"};
  std::vector<Field> out;
  Lister lister(payload, out);
  T m;
  layout(lister, m);
  lister.finish();
  if (!lister.ok()) return lister.error();
  return out;
}

/// Reads up to t_s; what follows is skipped as if it were broken.
class TimeReader : public cdr::Reader {
 public:
  using Reader::Reader;
  void real(const char* field, double& v, cdr::Real kind = cdr::Real::finite) {
    Reader::real(field, v, kind);
    if (!ok() || std::string_view(field) != "t_s") return;
    t_s = v;
    check(false, field, "is all that is asked");
  }
  template <class... Anything>
  void list(Anything&&...) {}  // all stand behind t_s
  std::optional<double> t_s;
};

template <class T, class... Others>
std::optional<double> time_of(const Topic& topic, std::span<const std::byte> payload) {
  if (topic.name == topic_of<T>().name) {
    TimeReader reader(payload);
    static thread_local T m;
    layout(reader, m);
    return reader.t_s;
  }
  if constexpr (sizeof...(Others) > 0) return time_of<Others...>(topic, payload);
  return {};
}

/// The first of the types whose topic it is.
template <class T, class... Others>
Result<std::vector<Field>, DecodeError> choose(const Topic& topic, std::span<const std::byte> payload) {
  if (topic.name == topic_of<T>().name) return list<T>(payload);
  if constexpr (sizeof...(Others) > 0) return choose<Others...>(topic, payload);
  return DecodeError{"topic", "must be one of the table"};
}

}  // namespace

bool same(const Field& a, const Field& b) {
  if (a.path != b.path || a.value.index() != b.value.index()) return false;
  if (const double* x = std::get_if<double>(&a.value))
    return std::bit_cast<std::uint64_t>(*x) == std::bit_cast<std::uint64_t>(std::get<double>(b.value));
  return a.value == b.value;
}

Result<std::vector<Field>, DecodeError> fields(const Topic& topic, std::span<const std::byte> payload) {
  return choose<ArmState, TorqueCommand, Goal, ObstacleSet, PlannerReport, ModeCommand, ServiceStatus,
                RobotDescription, SimulationClock, RunSummary>(topic, payload);
}

std::optional<double> sample_time_s(const Topic& topic, std::span<const std::byte> payload) {
  return time_of<ArmState, TorqueCommand, ObstacleSet, PlannerReport, SimulationClock>(topic, payload);
}

}  // namespace hamel::wire
