#pragma once
/// A folder for a test's files.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace hamel::test {

/// A new, empty folder that is gone with its object.
class Folder {
 public:
  Folder() : path_(testing::TempDir() + "/hamel-XXXXXX") {
    if (!mkdtemp(path_.data())) throw std::runtime_error("no folder " + path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace hamel::test
