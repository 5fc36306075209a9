#pragma once
/// What `hamel batch`, `bench planner` and `trade` run on: many independent jobs on several threads, their
/// results handed over in the order of the jobs: the outcome does not depend on how many threads there are.

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace hamel::client {

struct Batch {
  std::size_t jobs = 0;
  int workers = 1;                  ///< threads, >= 1
  std::function<bool()> stop = {};  ///< asked before each job, from any thread; true: start no more
  std::function<void(std::size_t)> progress = {};  ///< results taken so far, on the caller's thread
};

/// `asked`, or one for each core where that is 0.
inline int workers(int asked) {
  return asked > 0 ? asked : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

/// Calls work(i) for i = 0, 1, ... on the batch's threads and take(i, result) in that order on the caller's.
///
/// Jobs begin in order and every job begun is finished and taken, so what an early stop leaves are the
/// results 0..k-1.  An exception of work() or take() stops the batch and is thrown here, after all threads
/// have ended.
/// @return k, the number of results taken
template <class Work, class Take>
std::size_t run_batch(const Batch& batch, Work work, Take take) {
  using Outcome = decltype(work(std::size_t{}));
  std::mutex mutex;
  std::condition_variable changed;
  std::map<std::size_t, Outcome> done;
  std::exception_ptr failure;
  std::atomic<bool> stop{false};
  std::size_t begun = 0;
  int running = std::max(batch.workers, 1);

  const auto next = [&](std::size_t& i) {
    const std::lock_guard lock(mutex);
    if (stop || begun >= batch.jobs || (batch.stop && batch.stop())) return false;
    i = begun++;
    return true;
  };
  const auto labour = [&] {
    std::size_t i = 0;
    while (next(i)) {
      try {
        Outcome outcome = work(i);
        const std::lock_guard lock(mutex);
        done.emplace(i, std::move(outcome));
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
        stop = true;
      }
      changed.notify_one();
    }
    const std::lock_guard lock(mutex);
    --running;
    changed.notify_one();
  };
  std::vector<std::jthread> threads;
  for (int k = running; k > 0; --k) threads.emplace_back(labour);

  std::size_t taken = 0;
  std::unique_lock lock(mutex);
  while (!failure) {
    changed.wait(lock, [&] { return failure || running == 0 || done.contains(taken); });
    auto node = failure ? decltype(done.extract(taken)){} : done.extract(taken);
    if (node.empty()) break;  // the end, an early one, or a failure
    lock.unlock();
    try {
      take(taken, std::move(node.mapped()));
      ++taken;
      if (batch.progress) batch.progress(taken);
      lock.lock();
    } catch (...) {
      lock.lock();
      failure = std::current_exception();
      stop = true;
    }
  }
  lock.unlock();
  threads.clear();
  if (failure) std::rethrow_exception(failure);
  return taken;
}

}  // namespace hamel::client
