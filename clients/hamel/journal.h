#pragma once
/// A CSV that grows row by row and survives a kill: what is whole of it is kept, what is cut is done again.

#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::client {

/// Writes to PATH.partial, whose first line names the job, and becomes PATH when it is finished.
///
/// A row of PATH.partial ends with a tab and a sum (FNV-1a, 64 bits) over the job, the header and every row
/// up to it: one that is altered, missing, out of place or of another job does not fit.  Against accidents,
/// not against who computes the sums anew.
class Journal {
 public:
  /// Opens PATH.partial and keeps the rows of an earlier, unfinished run of the same job up to the first
  /// whose sum does not fit.  Refuses a PATH that is no ordinary file, and a PATH.partial of another job.
  static Result<std::unique_ptr<Journal>, Problem> open(const std::string& path, const std::string& job,
                                                        const std::string& header);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// Rows that were there already, in order.
  const std::vector<std::string>& kept() const { return kept_; }
  /// How many whole rows behind them were thrown away.
  std::size_t thrown_away() const { return thrown_away_; }
  /// Appends a row (one line without tabs) and hands it to the system.  False where that failed.
  bool add(const std::string& row);
  /// The table alone, at PATH; the partial file is gone.  Fails where a row's sum does not fit any more.
  std::optional<Problem> finish();

 private:
  Journal() = default;
  bool write(const std::string& row);
  std::string path_, begin_;  ///< begin_: the line that names the job, and the header
  std::vector<std::string> kept_;
  std::size_t thrown_away_ = 0, rows_ = 0;
  std::uint64_t sum_ = 0;  ///< of all so far
  std::FILE* file_ = nullptr;
};

}  // namespace hamel::client
