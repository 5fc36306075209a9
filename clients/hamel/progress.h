#pragma once
/// How far work is, on stderr.

#include <cstddef>
#include <string>

namespace hamel::client {

/// A batch: a line overwritten on a terminal, else one each ten seconds.
class Progress {
 public:
  /// @param unit  what is counted, "scenes"
  Progress(std::size_t of, std::string unit);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void say(std::size_t done, const std::string& what = {});

 private:
  const bool terminal_;
  const std::size_t of_;
  const std::string unit_;
  const double began_s_;
  double last_s_;
  bool shown_ = false;
};

/// Work that nobody knows the end of: what is being done, on a terminal only.
class Doing {
 public:
  Doing();
  ~Doing() { say(""); }
  Doing(const Doing&) = delete;
  Doing& operator=(const Doing&) = delete;
  /// Empty: nothing, and the line is cleared.
  void say(const std::string& what);

 private:
  const bool terminal_;
  double last_s_;
  bool shown_ = false;
};

}  // namespace hamel::client
