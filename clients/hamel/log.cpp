#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "clients/hamel/record.h"
#include "common/record/reader.h"
#include "common/wire/fields.h"

namespace hamel::client {

namespace {

using nlohmann::ordered_json;

ordered_json json_of(const wire::Field& f) {
  if (const auto* u = std::get_if<std::uint64_t>(&f.value)) return *u;
  if (const auto* d = std::get_if<double>(&f.value))
    return std::isfinite(*d) ? ordered_json(*d) : ordered_json(nullptr);
  if (const auto* b = std::get_if<bool>(&f.value)) return *b;
  if (const auto* s = std::get_if<std::string>(&f.value)) return *s;
  return ordered_json::array();
}

/// "links[2].point_m[1]" as a place in a JSON object.
ordered_json& place(ordered_json& root, const std::string& path) {
  ordered_json* at = &root;
  for (std::size_t i = 0; i < path.size();) {
    const std::size_t end = std::min(path.find_first_of(".[]", i), path.size());
    const std::string token = path.substr(i, end - i);
    if (!token.empty()) {
      const bool index = i > 0 && path[i - 1] == '[';
      at = index ? &(*at)[static_cast<std::size_t>(std::stoul(token))] : &(*at)[token];
    }
    i = end + 1;
  }
  return *at;
}

ordered_json json_of(const std::vector<wire::Field>& fields) {
  ordered_json out = ordered_json::object();
  for (const auto& f : fields) place(out, f.path) = json_of(f);
  return out;
}

std::string seconds(std::uint64_t ns) { return fmt::format("{:.9f}", static_cast<double>(ns) * 1e-9); }

/// The messages that are asked for, in order, with their topics; what is damaged is said on stderr unless
/// `quiet`.
template <class OnMessage>
int each_message(const char* verb, const LogArgs& args, OnMessage&& on_message, bool quiet = false) {
  auto reader = record::StreamReader::open(args.path);
  if (!reader) return runtime::complain(verb, {reader.error()});
  const Topic* wanted = args.topic.empty() ? nullptr : find_topic(args.topic);
  if (!args.topic.empty() && wanted == nullptr)
    return runtime::complain(verb, {{"--topic " + args.topic, "is no topic of hamel"}});
  std::map<std::uint16_t, std::string> topics;
  bool damaged = false, any = false;
  while (const auto item = reader.value().next()) {
    if (const auto* c = std::get_if<record::Channel>(&*item)) topics[c->id] = c->topic;
    if (const auto* d = std::get_if<record::Damage>(&*item)) {
      damaged = true;
      if (!quiet) fmt::print(stderr, "{}: {}: at byte {}: {}\n", verb, args.path, d->offset, d->what);
    }
    const auto* m = std::get_if<record::Message>(&*item);
    if (m == nullptr) continue;
    const std::string& name = topics[m->channel];
    if ((wanted != nullptr && name != wanted->name) || m->log_time < ns(args.begin_s) ||
        (args.end_s >= 0 && m->log_time > ns(args.end_s)))
      continue;
    any = true;
    if (!on_message(name, *m)) break;
  }
  if (!any && !quiet) fmt::print(stderr, "{}: {}: holds no such message\n", verb, args.path);
  return damaged ? runtime::kFailed : any ? runtime::kDone : runtime::kNoData;
}

struct Contents {
  std::map<std::string, std::uint64_t> counts;
  std::vector<record::Metadata> metadata;
  std::vector<record::Attachment> attachments;
  std::vector<record::Damage> damages;
  std::uint64_t messages = 0, begin = ~std::uint64_t{0}, end = 0;
  bool complete = false;
};

Result<Contents, Problem> contents(const std::string& path) {
  auto reader = record::StreamReader::open(path);
  if (!reader) return reader.error();
  Contents c;
  std::map<std::uint16_t, std::string> topics;
  while (auto item = reader.value().next()) {
    if (auto* a = std::get_if<record::Attachment>(&*item)) c.attachments.push_back(std::move(*a));
    if (auto* m = std::get_if<record::Metadata>(&*item)) c.metadata.push_back(std::move(*m));
    if (auto* d = std::get_if<record::Damage>(&*item)) c.damages.push_back(std::move(*d));
    if (const auto* ch = std::get_if<record::Channel>(&*item)) topics[ch->id] = ch->topic;
    if (const auto* m = std::get_if<record::Message>(&*item)) {
      ++c.messages;
      ++c.counts[topics[m->channel]];
      c.begin = std::min(c.begin, m->log_time);
      c.end = std::max(c.end, m->log_time);
    }
  }
  c.complete = reader.value().complete();
  if (c.messages == 0) c.begin = 0;
  return c;
}

void print_info(const std::string& path, const Contents& c) {
  fmt::print("{}\n  {} messages from {} s to {} s\n", path, c.messages, seconds(c.begin), seconds(c.end));
  for (const auto& [topic, n] : c.counts) fmt::print("  {:<20} {:>9}\n", topic, n);
  for (const auto& a : c.attachments) fmt::print("  attachment {}, {} bytes\n", a.name, a.data.size());
  for (const auto& m : c.metadata) {
    fmt::print("  {}:\n", m.name);
    for (const auto& [key, value] : m.entries) fmt::print("    {:<18} {}\n", key, value);
  }
  for (const auto& d : c.damages) fmt::print("  DAMAGED at byte {}: {}\n", d.offset, d.what);
  fmt::print("  {}\n", c.complete && c.damages.empty() ? "complete" : "not complete; see hamel log recover");
}

void print_info_json(const std::string& path, const Contents& c) {
  ordered_json j{{"file", path},
                 {"messages", c.messages},
                 {"begin_s", static_cast<double>(c.begin) * 1e-9},
                 {"end_s", static_cast<double>(c.end) * 1e-9},
                 {"complete", c.complete}};
  j["topics"] = ordered_json::object();
  for (const auto& [topic, n] : c.counts) j["topics"][topic] = n;
  j["attachments"] = ordered_json::object();
  for (const auto& a : c.attachments) j["attachments"][a.name] = a.data.size();
  j["metadata"] = ordered_json::object();
  for (const auto& m : c.metadata)
    for (const auto& [key, value] : m.entries) j["metadata"][m.name][key] = value;
  j["damages"] = ordered_json::array();
  for (const auto& d : c.damages) j["damages"].push_back({{"offset", d.offset}, {"what", d.what}});
  fmt::print("{}\n", j.dump(2, ' ', false, ordered_json::error_handler_t::replace));
}

}  // namespace

const Topic* find_topic(const std::string& name) {
  for (const Topic& t : kTopics)
    if (t.name == name || t.name == "hamel/v1/" + name) return &t;
  return nullptr;
}

int log_info(const LogArgs& args) {
  const auto c = contents(args.path);
  if (!c) return runtime::complain("hamel log info", {c.error()});
  if (args.json)
    print_info_json(args.path, c.value());
  else
    print_info(args.path, c.value());
  return c.value().complete && c.value().damages.empty() ? runtime::kDone : runtime::kFailed;
}

int log_cat(const LogArgs& args) {
  return each_message("hamel log cat", args, [&](const std::string& name, const record::Message& m) {
    const Topic* topic = find_topic(name);
    const auto fields =
        topic ? wire::fields(*topic, m.data)
              : Result<std::vector<wire::Field>, wire::DecodeError>(wire::DecodeError{"topic", "is unknown"});
    ordered_json j{{"topic", name}, {"log_time_ns", m.log_time}, {"sequence", m.sequence}};
    if (fields)
      j["message"] = json_of(fields.value());
    else
      j["undecodable"] = fmt::format("{} {}", fields.error().field, fields.error().rule);
    const std::string message =
        j.contains("message") ? j["message"].dump(-1, ' ', false, ordered_json::error_handler_t::replace)
                              : j["undecodable"].get<std::string>();
    if (args.json)
      fmt::print("{}\n", j.dump(-1, ' ', false, ordered_json::error_handler_t::replace));
    else
      fmt::print("{} {} {}\n", seconds(m.log_time), name, message);
    return std::ferror(stdout) == 0;
  });
}

namespace {

/// The columns of a table: every field of every message, each new one behind its neighbour.
class Columns {
 public:
  void add(const std::vector<wire::Field>& fields) {
    std::size_t at = 0;
    for (const wire::Field& f : fields) {
      if (std::holds_alternative<wire::EmptyList>(f.value)) continue;
      if (const auto known = place_.find(f.path); known != place_.end()) {
        at = known->second + 1;
        continue;
      }
      names_.insert(names_.begin() + static_cast<std::ptrdiff_t>(at), f.path);
      place_.clear();
      for (std::size_t i = 0; i < names_.size(); ++i) place_[names_[i]] = i;
      ++at;
    }
  }
  std::string header() const {
    std::string line = "log_time_s";
    for (const std::string& name : names_) line += "," + name;
    return line;
  }
  std::string row(std::uint64_t time, const std::vector<wire::Field>& fields) const {
    std::vector<std::string> cells(names_.size());
    for (const wire::Field& f : fields)
      if (const auto at = place_.find(f.path); at != place_.end()) cells[at->second] = cell(f);
    std::string line = seconds(time);
    for (const std::string& c : cells) line += "," + c;
    return line;
  }

 private:
  static std::string cell(const wire::Field& f) {
    if (const auto* d = std::get_if<double>(&f.value); d && !std::isfinite(*d)) return fmt::format("{}", *d);
    if (const auto* text = std::get_if<std::string>(&f.value)) {
      std::string out = "\"";
      for (const char c : *text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
      return out + "\"";
    }
    return json_of(f).dump();
  }
  std::vector<std::string> names_;
  std::map<std::string, std::size_t> place_;
};

}  // namespace

int log_csv(const LogArgs& args) {
  const char* verb = "hamel log csv";
  const auto decoded = [](const std::string& name, const record::Message& m, auto&& use) {
    const Topic* topic = find_topic(name);
    if (topic == nullptr) return;
    if (const auto fields = wire::fields(*topic, m.data)) use(fields.value());
  };
  std::error_code none;
  if (!args.out_path.empty() && std::filesystem::equivalent(args.path, args.out_path, none))
    return runtime::complain(verb, {{args.out_path, "is the recording itself"}});
  Columns columns;
  const auto gather = [&](const std::string& name, const record::Message& m) {
    decoded(name, m, [&](const auto& fields) { columns.add(fields); });
    return true;
  };
  if (const int code = each_message(verb, args, gather, true); code == runtime::kBadInput) return code;
  std::FILE* out = args.out_path.empty() ? stdout : std::fopen(args.out_path.c_str(), "w");
  if (out == nullptr)
    return runtime::complain(verb, {{args.out_path, std::string("cannot write: ") + std::strerror(errno)}});
  fmt::print(out, "{}\n", columns.header());
  const int code = each_message(verb, args, [&](const std::string& name, const record::Message& m) {
    decoded(name, m, [&](const auto& fields) { fmt::print(out, "{}\n", columns.row(m.log_time, fields)); });
    return std::ferror(out) == 0;
  });
  const bool bad = std::fflush(out) != 0 || std::ferror(out) != 0;
  if (out != stdout) std::fclose(out);
  if (bad)
    return runtime::complain(
        verb, {{args.out_path.empty() ? "stdout" : args.out_path, "could not be written whole"}});
  return code;
}

int log_recover(const LogArgs& args) {
  const auto compression = record::compression_from(args.compression);
  if (!compression) return runtime::complain("hamel log recover", {compression.error()});
  const auto r = record::recover(args.path, args.out_path, compression.value());
  if (!r) return runtime::complain("hamel log recover", {r.error()});
  for (const auto& d : r.value().damages)
    fmt::print(stderr, "{}: at byte {}: {}\n", args.path, d.offset, d.what);
  fmt::print("{}: {} messages, {} attachments{}\n", args.out_path, r.value().messages, r.value().attachments,
             r.value().damages.empty() ? "; nothing was missing" : "");
  return runtime::kDone;
}

}  // namespace hamel::client
