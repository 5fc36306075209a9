#include "clients/hamel/supervisor.h"

#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <thread>

namespace hamel::client {

using namespace std::chrono_literals;

namespace {
constexpr int kQuickRestarts = 3;  // deaths within two seconds of a start that are mended at once
constexpr int kQuickDeaths = 10;
constexpr int kBadInputCode = 2;
}  // namespace

void Supervisor::add(std::string name, std::vector<std::string> command, bool ends_by_itself) {
  Child c;
  c.name = std::move(name);
  c.command = std::move(command);
  c.ends_by_itself = ends_by_itself;
  children_.push_back(std::move(c));
}

void Supervisor::start(Child& c, Clock::time_point now) {
  std::vector<char*> argv;
  for (auto& a : c.command) argv.push_back(a.data());
  argv.push_back(nullptr);
  const pid_t parent = getpid();
  c.started = now;
  c.pid = fork();
  if (c.pid < 0) {
    spdlog::error("cannot start {}: {}", c.name, std::strerror(errno));
    c.restart_at = now + 1s;
    return;
  }
  if (c.pid > 0) return;
  // Child: a group of its own, so that Ctrl-C reaches the supervisor alone; ends when the supervisor does.
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(1);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  execv(argv[0], argv.data());
  const char* why = std::strerror(errno);
  (void)!write(STDERR_FILENO, argv[0], std::strlen(argv[0]));
  (void)!write(STDERR_FILENO, ": ", 2);
  (void)!write(STDERR_FILENO, why, std::strlen(why));
  (void)!write(STDERR_FILENO, "\n", 1);
  _exit(kBadInputCode);
}

void Supervisor::died(Child& c, int status, Clock::time_point now) {
  c.pid = -1;
  c.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  if (c.ends_by_itself && (c.exit_code == 0 || c.exit_code == 1 || c.exit_code == 3)) {
    c.done = true;
    return;
  }
  const std::string how = WIFEXITED(status) ? "exit code " + std::to_string(c.exit_code)
                                            : std::string("signal ") + strsignal(WTERMSIG(status));
  c.quick_deaths = now - c.started < 2s ? c.quick_deaths + 1 : 0;
  if (c.exit_code == kBadInputCode || c.quick_deaths >= kQuickDeaths) {
    spdlog::error("{} died ({}); giving it up", c.name, how);
    c.done = c.given_up = true;
    return;
  }
  c.restart_at = now + (c.quick_deaths > kQuickRestarts ? 500ms : 0ms);
  ++c.restarts;
  spdlog::warn("{} died ({}); starting it again", c.name, how);
}

void Supervisor::poll(Clock::time_point now) {
  for (Child& c : children_) {
    int status = 0;
    if (c.pid > 0 && waitpid(c.pid, &status, WNOHANG) == c.pid) died(c, status, now);
    if (c.pid < 0 && !c.done && now >= c.restart_at) start(c, now);
  }
}

void Supervisor::end() {
  for (const Child& c : children_)
    if (c.pid > 0) {
      kill(c.pid, SIGTERM);
      kill(c.pid, SIGCONT);  // a stopped child would not hear it
    }
  const auto deadline = Clock::now() + 1500ms;
  for (Child& c : children_) {
    int status = 0;
    while (c.pid > 0) {
      if (waitpid(c.pid, &status, WNOHANG) != 0) {
        c.pid = -1;
      } else if (Clock::now() > deadline) {
        kill(c.pid, SIGKILL);
        waitpid(c.pid, &status, 0);
        c.pid = -1;
      } else {
        std::this_thread::sleep_for(5ms);
      }
    }
    c.done = true;
  }
}

bool Supervisor::ended() const {
  return std::any_of(children_.begin(), children_.end(),
                     [](const Child& c) { return c.ends_by_itself && c.done; });
}

int Supervisor::restarts() const {
  int n = 0;
  for (const Child& c : children_) n += c.restarts;
  return n;
}

const Supervisor::Child* Supervisor::failed() const {
  for (const Child& c : children_)
    if (c.given_up) return &c;
  return nullptr;
}

}  // namespace hamel::client
