/// parse_text(): goes on behind a bad value, so that one reading lists them all.
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

/// Moves a note that the parser put behind a word to the word itself.
bool move_back_to(const std::string& word, const std::string& text, Note& note) {
  const std::size_t behind = offset_of(text, note.line, note.column);
  const std::size_t at = behind == 0 ? std::string::npos : text.rfind(word, behind - 1);
  if (at == std::string::npos) return false;
  note = place_of(text, at, note.what);
  return true;
}

/// The field whose value, or list of values, holds the byte `value`.
TextPosition field_of(const std::string& text, std::size_t value) {
  const std::size_t colon = text.rfind(':', value);
  const std::size_t last = colon == std::string::npos ? colon : text.find_last_not_of(" \t\r\n", colon - 1);
  if (last == std::string::npos) return {};
  const std::size_t before = text.find_last_of(" \t\r\n{},;]>", last);
  const Note n = place_of(text, before == std::string::npos ? 0 : before + 1, "");
  return {n.line + 1, n.column + 1};
}

/// Writes 0 over the value an error is about and moves the error there.  False when it is about something
/// else.
bool mend(std::string& text, const google::protobuf::FileDescriptor* file, Note& error, ParsedText& out) {
  const std::string choice = quoted_after(error.what, "Unknown enumeration value of ");
  const std::string truth = quoted_after(error.what, "Value: ");
  const std::string word = choice.empty() ? truth : choice;
  const auto begins = [&](const char* with) { return error.what.starts_with(with); };
  const bool of_number =
      begins("Expected integer, got") || begins("Expected double, got") || begins("Integer out of range");
  if (word.empty() && !of_number) return false;
  if (!word.empty() && !move_back_to(word, text, error)) return false;
  error.what = explain(file, error.what);
  const std::size_t begin = offset_of(text, error.line, error.column);
  const std::size_t end = word.empty() ? token_end(text, begin) : begin + word.size();
  if (end <= begin) return false;
  out.mended.push_back(field_of(text, begin));
  std::fill(text.begin() + static_cast<std::ptrdiff_t>(begin),
            text.begin() + static_cast<std::ptrdiff_t>(end), ' ');
  text[begin] = '0';
  return true;
}

Problem to_problem(const std::string& name, const Note& n) {
  return {name + ":" + std::to_string(n.line + 1) + ":" + std::to_string(n.column + 1), n.what};
}

}  // namespace

std::string explain(const google::protobuf::FileDescriptor* schema, const std::string& what) {
  const std::string type = quoted_after(what, "Message type "),
                    field = quoted_after(what, "has no field named ");
  const std::string choice = quoted_after(what, "Unknown enumeration value of ");
  if (!choice.empty()) {
    const std::string chosen = quoted_after(what, "for field ");
    return chosen + " = " + choice + ", must be one of " + choices(schema, chosen);
  }
  const auto* descriptor = schema->FindMessageTypeByName(type.substr(type.rfind('.') + 1));
  if (descriptor == nullptr || field.empty()) return what;
  std::string out = "unknown field \"" + field + "\"; " + descriptor->name() + " has ";
  for (int i = 0; i < descriptor->field_count(); ++i)
    out += (i == 0 ? "" : ", ") + descriptor->field(i)->name();
  return out;
}

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
    const bool mended = mend(text, file, error, out);
    notes.push_back(error);
    if (!mended) break;
  }
  Notes ignored;  // the reading that counts: same text, now with places
  google::protobuf::TextFormat::Parser parser;
  parser.RecordErrorsTo(&ignored);
  parser.AllowUnknownField(true);
  parser.WriteLocationsTo(&out.positions);
  (void)parser.ParseFromString(text, &message);
  for (Note& n : unknown) {
    move_back_to(quoted_after(n.what, "has no field named "), text, n);
    n.what = explain(file, n.what);
  }
  notes.insert(notes.end(), unknown.begin(), unknown.end());
  std::stable_sort(notes.begin(), notes.end(), [](const Note& a, const Note& b) {
    return a.line != b.line ? a.line < b.line : a.column < b.column;
  });
  for (const Note& n : notes) out.problems.push_back(to_problem(name, n));
}

}  // namespace hamel::files
