#include "common/runtime/realtime.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
#include <cstring>
#include <optional>

namespace hamel::runtime {

namespace {

std::string limit(int which) {
  rlimit l{};
  getrlimit(static_cast<__rlimit_resource>(which), &l);
  return l.rlim_cur == RLIM_INFINITY ? "unlimited" : std::to_string(l.rlim_cur);
}

std::optional<cpu_set_t> processors_before;  // go_realtime(), which comes before any other thread

}  // namespace

Problems go_realtime(const RealtimeOptions& o) {
  Problems problems;
  if (cpu_set_t set; sched_getaffinity(0, sizeof set, &set) == 0) processors_before = set;
  if (o.cpu >= 0) {
    cpu_set_t set;
    CPU_ZERO(&set);
    if (o.cpu < CPU_SETSIZE) CPU_SET(static_cast<unsigned>(o.cpu), &set);
    if (sched_setaffinity(0, sizeof set, &set) != 0)
      problems.push_back({"--cpu", "= " + std::to_string(o.cpu) + ", this process may not run there: " +
                                       std::strerror(errno) + "; see taskset -p $$"});
  }
  if (o.lock_memory && mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
    problems.push_back({"--lock-memory", std::string("refused: ") + std::strerror(errno) +
                                             "; RLIMIT_MEMLOCK is " + limit(RLIMIT_MEMLOCK) +
                                             " bytes: raise it (ulimit -l unlimited as root, "
                                             "LimitMEMLOCK=infinity in the unit)"});
  if (o.priority > 0) {
    const sched_param p{.sched_priority = o.priority};
    if (sched_setscheduler(0, SCHED_FIFO, &p) != 0)
      problems.push_back({"--priority", "= " + std::to_string(o.priority) +
                                            ", refused: " + std::strerror(errno) + "; RLIMIT_RTPRIO is " +
                                            limit(RLIMIT_RTPRIO) +
                                            ": raise it (setcap cap_sys_nice+ep on the program, "
                                            "LimitRTPRIO=99 in the unit)"});
  }
  return problems;
}

void go_ordinary() noexcept {
  const sched_param none{};
  sched_setscheduler(0, SCHED_OTHER, &none);
  if (processors_before) sched_setaffinity(0, sizeof *processors_before, &*processors_before);
}

}  // namespace hamel::runtime
