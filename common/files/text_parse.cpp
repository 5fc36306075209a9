/// parse_text(): goes on behind a bad value, so that one reading lists them all.
#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/tokenizer.h>

#include <algorithm>

#include "common/files/text_fields.h"

namespace hamel::files {
namespace {

using google::protobuf::FieldDescriptor;

struct Note {
  int line = 0, column = 0;  // from 0
  std::string what;
};

class Notes : public google::protobuf::io::ErrorCollector {
 public:
  void AddError(int line, google::protobuf::io::ColumnNumber column, const std::string& what) override {
    errors.push_back({line, column, what});
  }
  void AddWarning(int line, google::protobuf::io::ColumnNumber column, const std::string& what) override {
    warnings.push_back({line, column, what});
  }
  std::vector<Note> errors, warnings;
};

/// Byte of a line and column; the tokenizer counts a tab to the next multiple of 8.
std::size_t offset_of(const std::string& text, int line, int column) {
  std::size_t i = 0;
  for (; line > 0 && i < text.size(); ++i) line -= text[i] == '\n';
  for (int at = 0; at < column && i < text.size() && text[i] != '\n'; ++i)
    at = text[i] == '\t' ? (at / 8 + 1) * 8 : at + 1;
  return i;
}

Note place_of(const std::string& text, std::size_t offset, std::string what) {
  Note n{0, 0, std::move(what)};
  for (std::size_t i = 0; i < offset; ++i) {
    n.column = text[i] == '\t' ? (n.column / 8 + 1) * 8 : n.column + 1;
    if (text[i] == '\n') n = {n.line + 1, 0, std::move(n.what)};
  }
  return n;
}

/// What stands between the first two quotes behind `key` in a message of the parser.
std::string quoted_after(const std::string& message, const std::string& key) {
  const std::size_t from = message.find(key + "\"");
  if (from == std::string::npos) return {};
  const std::size_t begin = from + key.size() + 1;
  return message.substr(begin, message.find('"', begin) - begin);
}

/// The names an enumeration field may have, found by the field's name anywhere in the schema.
std::string choices(const google::protobuf::FileDescriptor* file, const std::string& field_name) {
  std::string out;
  for (int i = 0; i < file->message_type_count(); ++i) {
    const FieldDescriptor* field = file->message_type(i)->FindFieldByName(field_name);
    if (field == nullptr || field->enum_type() == nullptr) continue;
    for (int k = 0; k < field->enum_type()->value_count(); ++k)
      out += (out.empty() ? "" : ", ") + field->enum_type()->value(k)->name();
  }
  return out;
}

/// The token at an offset: a quoted string, or all up to a separator.
std::size_t token_end(const std::string& text, std::size_t begin) {
  if (begin < text.size() && (text[begin] == '"' || text[begin] == '\''))
    return std::min(text.find(text[begin], begin + 1), text.size() - 1) + 1;
  return std::min(text.find_first_of(" \t\r\n,:;[]{}<>#", begin), text.size());
}

/// Writes 0 over the value an error is about.  False when the error is about something else.  `error` then
/// tells the value's own place and rule.
bool mend(std::string& text, const google::protobuf::FileDescriptor* file, Note& error) {
  const std::string what = error.what;
  std::size_t begin = offset_of(text, error.line, error.column);
  std::size_t end = 0;
  const std::string choice = quoted_after(what, "Unknown enumeration value of ");
  const std::string truth = quoted_after(what, "Value: ");
  if (!choice.empty() || !truth.empty()) {  // these are reported behind the value
    const std::string value = choice.empty() ? truth : choice;
    begin = begin == 0 ? std::string::npos : text.rfind(value, begin - 1);
    if (begin == std::string::npos) return false;
    end = begin + value.size();
    const std::string field = quoted_after(what, "for field ");
    error =
        place_of(text, begin,
                 choice.empty() ? what : field + " = " + value + ", must be one of " + choices(file, field));
  } else if (what.find("Expected integer, got") == 0 || what.find("Expected double, got") == 0 ||
             what.find("Integer out of range") == 0) {
    end = token_end(text, begin);
  } else {
    return false;
  }
  if (end <= begin) return false;
  std::fill(text.begin() + static_cast<std::ptrdiff_t>(begin),
            text.begin() + static_cast<std::ptrdiff_t>(end), ' ');
  text[begin] = '0';
  return true;
}

Problem to_problem(const std::string& name, const Note& n) {
  return {name + ":" + std::to_string(n.line + 1) + ":" + std::to_string(n.column + 1), n.what};
}

/// "Message type "hamel.text.Planner" has no field named "kq"." as a rule with the names that are allowed.
std::string unknown_field(const google::protobuf::FileDescriptor* file, const std::string& what) {
  const std::string type = quoted_after(what, "Message type "),
                    field = quoted_after(what, "has no field named ");
  const auto* descriptor = file->FindMessageTypeByName(type.substr(type.rfind('.') + 1));
  if (descriptor == nullptr || field.empty()) return what;
  std::string out = "unknown field \"" + field + "\"; " + descriptor->name() + " has ";
  for (int i = 0; i < descriptor->field_count(); ++i)
    out += (i == 0 ? "" : ", ") + descriptor->field(i)->name();
  return out;
}

}  // namespace

void parse_text(std::string text, const std::string& name, google::protobuf::Message& message,
                ParsedText& out) {
  constexpr int kMostRounds = 50;
  const google::protobuf::FileDescriptor* file = message.GetDescriptor()->file();
  std::vector<Note> notes, unknown;
  for (int round = 0; round < kMostRounds; ++round) {
    Notes heard;
    google::protobuf::TextFormat::Parser dry;
    dry.RecordErrorsTo(&heard);
    dry.AllowUnknownField(true);
    message.Clear();
    out.complete = dry.ParseFromString(text, &message);
    unknown = heard.warnings;
    if (out.complete || heard.errors.empty()) break;
    Note error = heard.errors.front();
    const bool mended = mend(text, file, error);
    notes.push_back(error);
    if (!mended) break;
    out.mended_lines.push_back(error.line + 1);
  }
  Notes ignored;  // the reading that counts: same text, now with places
  google::protobuf::TextFormat::Parser parser;
  parser.RecordErrorsTo(&ignored);
  parser.AllowUnknownField(true);
  parser.WriteLocationsTo(&out.positions);
  (void)parser.ParseFromString(text, &message);
  for (Note& n : unknown) n.what = unknown_field(file, n.what);
  notes.insert(notes.end(), unknown.begin(), unknown.end());
  std::stable_sort(notes.begin(), notes.end(), [](const Note& a, const Note& b) {
    return a.line != b.line ? a.line < b.line : a.column < b.column;
  });
  for (const Note& n : notes) out.problems.push_back(to_problem(name, n));
}

}  // namespace hamel::files
