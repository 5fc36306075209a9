#include <filesystem>
#include <map>

#include "common/record/reader.h"
#include "common/record/writer.h"

namespace hamel::record {
namespace {

/// Copies items; schemas and channels get new numbers and are written once.
class Copy {
 public:
  explicit Copy(Writer& out) : out_(out) {}

  void operator()(const Schema& s) {
    if (!schemas_.contains(s.id)) schemas_[s.id] = out_.add(s);
  }
  void operator()(const Channel& c) {
    if (channels_.contains(c.id)) return;
    Channel copy = c;
    copy.schema = schemas_.contains(c.schema) ? schemas_[c.schema] : std::uint16_t{0};
    channels_[c.id] = out_.add(copy);
  }
  void operator()(const Message& m) {
    hole = hole || (damaged_ && found.messages > 0);
    Message copy = m;
    copy.channel = channels_[m.channel];
    found.messages += out_.write(copy, {}) ? 1 : 0;
  }
  void operator()(const Attachment& a) { found.attachments += out_.write(a) ? 1 : 0; }
  void operator()(const Metadata& m) { found.metadata += out_.write(m) ? 1 : 0; }
  void operator()(const Damage& d) {
    found.damages.push_back(d);
    damaged_ = found.messages > 0;
  }

  Recovery found;
  bool hole = false;  ///< messages follow a damage that others came before

 private:
  Writer& out_;
  bool damaged_ = false;
  std::map<std::uint16_t, std::uint16_t> schemas_, channels_;
};

}  // namespace

Result<Recovery, Problem> recover(const std::string& in, const std::string& out, Compression compression) {
  std::error_code ignored;
  if (std::filesystem::equivalent(in, out, ignored))
    return Problem{out, "is the file to recover; name another"};
  auto reader = StreamReader::open(in);
  if (!reader) return reader.error();
  auto writer = Writer::create(out, {.compression = compression});
  if (!writer) return writer.error();
  Copy copy(*writer.value());
  while (const auto item = reader.value().next()) std::visit(copy, *item);
  if (copy.hole)
    writer.value()->write(
        Metadata{kRecovered, {{"hole", std::to_string(copy.found.damages.size()) + " damages"}}});
  if (!writer.value()->close()) return *writer.value()->problem();
  copy.found.complete = reader.value().complete();
  return std::move(copy.found);
}

}  // namespace hamel::record
