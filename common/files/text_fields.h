#pragma once
/// Fields of a protobuf message by their path in text, "perception.obstacles[2].sphere.radius_m".

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>

#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::files {

/// Line and column of a field, from 1.  line 0: not in the text.
struct TextPosition {
  int line = 0;
  int column = 0;
};

/// A text and what its parser learnt about it.
struct ParsedText {
  google::protobuf::TextFormat::ParseInfoTree positions;
  Problems problems;                 ///< sorted by place; `where` is "name:line:column"
  std::vector<TextPosition> mended;  ///< fields whose value was bad and stands as 0
  bool complete = true;              ///< false: the text broke off at a problem, fields behind it are missing
};

/// Reads `text` into `message` and lists every unknown field and bad value in it.  A value that cannot be
/// read stands as 0 in `message`, an unknown field is passed over; other errors end the reading.
void parse_text(std::string text, const std::string& name, google::protobuf::Message& message,
                ParsedText& out);

/// What the parser of protobuf said, as a rule with the names that are allowed.
std::string explain(const google::protobuf::FileDescriptor* schema, const std::string& what);

/// Where the field at `path` stands; of the nearest one around it when it does not stand there itself.
TextPosition find_position(const google::protobuf::Message& message,
                           const google::protobuf::TextFormat::ParseInfoTree& positions,
                           const std::string& path);

/// Does "path=value" to `message`; an empty string, or why not.
std::string apply_override(const std::string& text, google::protobuf::Message& message);

/// True when a problem at `path` is about the field that the override "field=value" set: one lies within the
/// other.
bool override_touches(const std::string& text, const std::string& path);

}  // namespace hamel::files
