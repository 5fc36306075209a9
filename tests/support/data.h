#pragma once
/// Where data for tests is that is no part of the project.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace hamel::test {

/// The data folder: HAMEL_DATA, else ../shared/data beside the source tree where that exists, else empty.
inline std::filesystem::path data_folder() {
  if (const char* named = std::getenv("HAMEL_DATA")) return named;
  std::error_code error;
  for (std::filesystem::path up = std::filesystem::path(HAMEL_SOURCE_DIR).parent_path();
       up.has_relative_path(); up = up.parent_path())
    if (std::filesystem::is_directory(up / "shared/data", error)) return up / "shared/data";
  return {};
}

/// Paths of the files in a folder with this extension, in order.
inline std::vector<std::string> files_in(const std::filesystem::path& folder, const std::string& extension) {
  std::vector<std::string> out;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == extension) out.push_back(entry.path().string());
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace hamel::test

/// Skips a test, and says so, where the data is absent; fails it when HAMEL_DATA names a folder that lacks
/// it.
#define HAMEL_NEEDS_DATA(sub)                                                                      \
  if (!std::filesystem::exists(hamel::test::data_folder() / (sub))) {                              \
    if (std::getenv("HAMEL_DATA") != nullptr)                                                      \
      FAIL() << "HAMEL_DATA is set, but " << (hamel::test::data_folder() / (sub)) << " is absent"; \
    GTEST_SKIP() << "data absent: " << (sub) << " (set HAMEL_DATA)";                               \
  }
