#include "common/runtime/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>

#include <cstdlib>

namespace hamel::runtime {

void start_log(const std::string& name, bool verbose) {
  const auto mode = std::getenv("NO_COLOR") ? spdlog::color_mode::never : spdlog::color_mode::automatic;
  auto logger = spdlog::stderr_color_mt(name, mode);
  logger->set_pattern("%H:%M:%S.%e %n %^%l%$ %v");
  logger->set_level(verbose ? spdlog::level::debug : spdlog::level::info);
  spdlog::set_error_handler([](const std::string&) {});  // a full disk under stderr stops nobody
  spdlog::set_default_logger(std::move(logger));
}

}  // namespace hamel::runtime
