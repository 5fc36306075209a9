#include "common/runtime/systemd.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace hamel::runtime {

SystemdNotifier::SystemdNotifier() {
  const char* path = std::getenv("NOTIFY_SOCKET");
  sockaddr_un address{};
  if (path == nullptr || std::strlen(path) >= sizeof address.sun_path) return;
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path, std::strlen(path));
  if (path[0] == '@') address.sun_path[0] = '\0';  // an abstract one
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + std::strlen(path));
  socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket_ >= 0 && connect(socket_, reinterpret_cast<const sockaddr*>(&address), length) != 0) {
    ::close(socket_);
    socket_ = -1;
  }
  if (const char* usec = std::getenv("WATCHDOG_USEC"))
    period_ = std::chrono::microseconds(std::strtoull(usec, nullptr, 10)) / 2;
}

SystemdNotifier::~SystemdNotifier() {
  if (socket_ >= 0) ::close(socket_);
}

bool SystemdNotifier::poll(Clock::time_point now) {
  if (socket_ < 0 || (ready_ && now < next_)) return false;
  say(ready_ ? "WATCHDOG=1" : "READY=1");
  ready_ = true;
  if (period_.count() > 0) next_ = now + period_;
  return false;
}

void SystemdNotifier::say(const char* what) const noexcept {
  if (socket_ >= 0) (void)!send(socket_, what, std::strlen(what), MSG_NOSIGNAL);
}

}  // namespace hamel::runtime
