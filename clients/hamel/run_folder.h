#pragma once
/// The folder of one `hamel up`: checkpoints of its services, gone with it.

#include <memory>
#include <string>

#include "common/base/result.h"

namespace hamel::client {

/// Folders hamel-XXXXXX in the system's temporary folder whose owner is dead (a killed `hamel up`); each is
/// known by a locked file in it, whose lock ends with its process, however it ended.
std::vector<std::string> abandoned_folders();

class RunFolder {
 public:
  /// Makes a new one, after removing those that are abandoned.
  static Result<std::unique_ptr<RunFolder>, Problem> make();
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  RunFolder(std::string path, int lock) : path_(std::move(path)), lock_(lock) {}
  std::string path_;
  int lock_;
};

}  // namespace hamel::client
