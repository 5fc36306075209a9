#pragma once
/// A CSV that grows row by row and survives a kill: what is whole of it is kept, what is cut is done again.

#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::client {

/// Writes to PATH.partial, whose first line names the job, and becomes PATH when it is finished.
class Journal {
 public:
  /// Opens PATH.partial and keeps the whole rows of an earlier, unfinished run of the same job.  Refuses a
  /// PATH that is no ordinary file, and a PATH.partial of another job.
  static Result<std::unique_ptr<Journal>, Problem> open(const std::string& path, const std::string& job,
                                                        const std::string& header);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// Rows that were there already, in order.
  const std::vector<std::string>& kept() const { return kept_; }
  /// Appends a row and hands it to the system.  False where that failed.
  bool add(const std::string& row);
  /// The table without the line that names the job, at PATH; the partial file is gone.
  std::optional<Problem> finish();

 private:
  Journal() = default;
  std::string path_, head_;
  std::vector<std::string> kept_;
  std::FILE* file_ = nullptr;
};

}  // namespace hamel::client
