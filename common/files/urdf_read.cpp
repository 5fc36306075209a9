#include "common/files/urdf_read.h"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <exception>
#include <mutex>

namespace hamel::files {
namespace {

class Capture : public console_bridge::OutputHandler {
 public:
  explicit Capture(std::vector<std::string>& errors) : errors_(errors) {
    console_bridge::useOutputHandler(this);
  }
  ~Capture() override { console_bridge::restorePreviousOutputHandler(); }
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) errors_.push_back(text);
  }

 private:
  std::vector<std::string>& errors_;
};

}  // namespace

UrdfModel read_urdf(const std::string& text) {
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  UrdfModel out;
  const Capture capture(out.errors);
  try {
    out.model = urdf::parseURDF(text);
  } catch (const std::exception& e) {
    out.errors.emplace_back(e.what());
  }
  return out;
}

}  // namespace hamel::files
