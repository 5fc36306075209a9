#pragma once
/// Whether a file may be written, before hours of work go into it.

#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::client {

/// What is wrong with writing `path`: its folder is not there, or it is one of the files that are read.  None
/// where `path` is empty.
/// @param option  names it in the answer, e.g. "--csv"
std::optional<Problem> output_problem(const std::string& option, const std::string& path,
                                      const std::vector<std::string>& read);

}  // namespace hamel::client
