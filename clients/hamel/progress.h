#pragma once
/// How far a batch is, on stderr: a line overwritten on a terminal, else one each ten seconds.

#include <cstddef>
#include <string>

namespace hamel::client {

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

}  // namespace hamel::client
