#include "common/files/text_fields.h"

#include <google/protobuf/io/tokenizer.h>

#include <charconv>
#include <optional>

namespace hamel::files {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::TextFormat;

/// One name of a path with its index, -1: none.
struct Step {
  std::string name;
  int index = -1;
};

/// The steps of "a.b[2].c" or "a.b.2.c"; nothing when it is not a path.
std::optional<std::vector<Step>> split_path(std::string_view path) {
  std::vector<Step> steps;
  while (!path.empty()) {
    const std::size_t end = path.find_first_of(".[]");
    const std::string_view word = path.substr(0, end);
    path.remove_prefix(end == std::string_view::npos ? path.size() : end + 1);
    if (word.empty()) continue;  // between "]" and "."
    if (word.front() < '0' || word.front() > '9') {
      steps.push_back({std::string(word), -1});
      continue;
    }
    int index = -1;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), index);
    if (error != std::errc() || stop != word.data() + word.size() || steps.empty() || steps.back().index >= 0)
      return {};
    steps.back().index = index;
  }
  if (steps.empty()) return {};
  return steps;
}

/// Keeps the first error of a reading.
class FirstError : public google::protobuf::io::ErrorCollector {
 public:
  void AddError(int, google::protobuf::io::ColumnNumber, const std::string& what) override {
    if (text.empty()) text = what;
  }
  std::string text;
};

std::string merge(const std::string& text, Message& message) {
  FirstError error;
  TextFormat::Parser parser;
  parser.RecordErrorsTo(&error);
  if (parser.MergeFromString(text, &message)) return {};
  return error.text.empty() ? "cannot be read" : explain(message.GetDescriptor()->file(), error.text);
}

/// A string value may stand without quotes.
std::string quoted(const FieldDescriptor* field, const std::string& value) {
  const bool bare = value.empty() || (value.front() != '"' && value.front() != '\'' && value.front() != '[');
  if (field->cpp_type() != FieldDescriptor::CPPTYPE_STRING || !bare) return value;
  std::string out = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

/// Replaces element `index` of a list, or appends to it, by writing the list anew.
std::string set_element(Message& parent, const FieldDescriptor* field, int index, const std::string& value) {
  const auto* reflection = parent.GetReflection();
  const int size = reflection->FieldSize(parent, field);
  if (index > size)
    return "index " + std::to_string(index) + " is past the end, the list has " + std::to_string(size);
  std::string all;
  for (int i = 0; i < std::max(size, index + 1); ++i) {
    std::string element = value;
    if (i != index) TextFormat::PrintFieldValueToString(parent, field, i, &element);
    const bool nested = i != index && field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    all += field->name() + ": " + (nested ? "{" + element + "}" : element) + "\n";
  }
  reflection->ClearField(&parent, field);
  return merge(all, parent);
}

std::string set_field(Message& parent, const FieldDescriptor* field, int index, const std::string& value) {
  if (index >= 0 && !field->is_repeated()) return field->name() + " is not a list";
  if (index >= 0) return set_element(parent, field, index, quoted(field, value));
  if (const auto* oneof = field->real_containing_oneof()) parent.GetReflection()->ClearOneof(&parent, oneof);
  parent.GetReflection()->ClearField(&parent, field);
  return merge(field->name() + ": " + quoted(field, value), parent);
}

/// The message one step down, made where it is absent; null and `why` when there is none.
Message* descend(Message& from, const FieldDescriptor* field, int index, std::string& why) {
  const auto* reflection = from.GetReflection();
  if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE)
    why = field->name() + " has no fields";
  else if (field->is_repeated() && index < 0)
    why = field->name() + " is a list, name one: " + field->name() + "[0]";
  else if (!field->is_repeated() && index >= 0)
    why = field->name() + " is not a list";
  else if (!field->is_repeated())
    return reflection->MutableMessage(&from, field);
  else if (index < reflection->FieldSize(from, field))
    return reflection->MutableRepeatedMessage(&from, field, index);
  else if (index == reflection->FieldSize(from, field))
    return reflection->AddMessage(&from, field);
  else
    why = "index " + std::to_string(index) + " is past the end of " + field->name();
  return nullptr;
}

}  // namespace

TextPosition find_position(const Message& message, const TextFormat::ParseInfoTree& positions,
                           const std::string& path) {
  TextPosition found;
  const auto steps = split_path(path);
  if (!steps) return found;
  const google::protobuf::Descriptor* type = message.GetDescriptor();
  const TextFormat::ParseInfoTree* tree = &positions;
  for (const Step& step : *steps) {
    const FieldDescriptor* field = type->FindFieldByName(step.name);
    if (field == nullptr) break;
    const int index = field->is_repeated() ? std::max(step.index, 0) : -1;
    TextFormat::ParseLocation at = tree->GetLocation(field, index);
    if (at.line < 0 && index > 0) at = tree->GetLocation(field, 0);  // a list [a, b] has one place
    if (at.line < 0) break;
    found = {at.line + 1, at.column + 1};
    type = field->message_type();
    if (type == nullptr) break;
    tree = tree->GetTreeForNested(field, index);
    if (tree == nullptr) break;
  }
  return found;
}

std::string apply_override(const std::string& text, Message& message) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return "must be field=value";
  const auto steps = split_path(std::string_view(text).substr(0, equals));
  if (!steps) return "must name a field, such as planner.kp or q0[1]";
  Message* at = &message;
  for (std::size_t i = 0; i < steps->size(); ++i) {
    const Step& step = (*steps)[i];
    const FieldDescriptor* field = at->GetDescriptor()->FindFieldByName(step.name);
    if (field == nullptr)
      return explain(message.GetDescriptor()->file(), "Message type \"" + at->GetDescriptor()->full_name() +
                                                          "\" has no field named \"" + step.name + "\".");
    if (i + 1 == steps->size()) return set_field(*at, field, step.index, text.substr(equals + 1));
    std::string why;
    at = descend(*at, field, step.index, why);
    if (at == nullptr) return why;
  }
  return {};
}

bool override_touches(const std::string& text, const std::string& path) {
  const auto a = split_path(std::string_view(text).substr(0, text.find('=')));
  const auto b = split_path(path);
  if (!a || !b) return false;
  for (std::size_t i = 0; i < std::min(a->size(), b->size()); ++i) {
    if ((*a)[i].name != (*b)[i].name) return false;
    if ((*a)[i].index >= 0 && (*b)[i].index >= 0 && (*a)[i].index != (*b)[i].index) return false;
  }
  return true;
}

}  // namespace hamel::files
