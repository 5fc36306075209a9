#include "common/runtime/checkpoint.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <atomic>
#include <cerrno>
#include <cstring>

#include "common/runtime/log.h"

namespace hamel::runtime {

namespace {

constexpr std::uint32_t kMagic = 0x4c4d4148;  // "HAML"
constexpr std::uint32_t kLayout = 3;

std::uint64_t checksum(const void* data, std::size_t size, std::uint64_t sequence) {
  return XXH3_64bits_withSeed(data, size, sequence);
}

Problem failed(const std::string& path, const char* what) {
  return {path, std::string(what) + ": " + std::strerror(errno)};
}

}  // namespace

struct Checkpoint::Slot {
  std::uint32_t magic, layout, kind, size;
  std::uint64_t checksum, sequence;
  std::byte payload[1];
};

Checkpoint::Slot* Checkpoint::slot(int i) const noexcept {
  return reinterpret_cast<Slot*>(map_ + static_cast<std::size_t>(i) * (length_ / 2));
}

Result<std::unique_ptr<Checkpoint>, Problem> Checkpoint::open(const std::string& path, std::uint32_t kind,
                                                              std::size_t capacity) {
  std::unique_ptr<Checkpoint> c(new Checkpoint);
  c->fd_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (c->fd_ < 0) return failed(path, "cannot open the checkpoint");
  if (flock(c->fd_, LOCK_EX | LOCK_NB) != 0)
    return Problem{path, "is in use by another process: one writer a checkpoint"};
  const std::size_t half = (sizeof(Slot) + capacity + 4095) / 4096 * 4096;
  c->length_ = 2 * half;
  c->capacity_ = capacity;
  c->kind_ = kind;
  if (ftruncate(c->fd_, static_cast<off_t>(c->length_)) != 0)
    return failed(path, "cannot size the checkpoint");
  // A mapped page that the disk cannot back kills the writer later: claim the space now.
  if (const int e = posix_fallocate(c->fd_, 0, static_cast<off_t>(c->length_)); e != 0) {
    errno = e;
    return failed(path, "no room for the checkpoint");
  }
  void* m = mmap(nullptr, c->length_, PROT_READ | PROT_WRITE, MAP_SHARED, c->fd_, 0);
  if (m == MAP_FAILED) return failed(path, "cannot map the checkpoint");
  c->map_ = static_cast<std::byte*>(m);
  return c;
}

Result<std::unique_ptr<Checkpoint>, Problem> Checkpoint::resume(
    const std::string& dir, const std::string& service, std::uint32_t arm, std::uint32_t kind,
    std::size_t capacity, const std::function<bool(std::span<const std::byte>)>& restore) {
  const std::string path = dir + "/" + service + "-" + std::to_string(arm) + ".checkpoint";
  auto c = open(path, kind, capacity);
  if (!c) return c;
  std::string note;
  const auto bytes = c.value()->load(note);
  if (!note.empty()) spdlog::warn("{}: {}", path, note);
  if (!bytes.empty() && !restore(bytes))
    spdlog::warn("{}: of another scene or version, refused; starting afresh", path);
  return c;
}

Checkpoint::~Checkpoint() {
  if (map_) munmap(map_, length_);
  if (fd_ >= 0) ::close(fd_);
}

std::vector<std::byte> Checkpoint::load(std::string& note) const {
  note.clear();
  const Slot* best = nullptr;
  for (int i = 0; i < 2; ++i) {
    const Slot* s = slot(i);
    if (s->magic == 0 && s->sequence == 0) continue;  // never written
    if (s->magic != kMagic || s->layout != kLayout || s->kind != kind_) {
      note += "slot of a foreign format passed over; ";
    } else if (s->size > capacity_ || s->checksum != checksum(s->payload, s->size, s->sequence)) {
      note += "damaged slot passed over; ";
    } else if (!best || s->sequence > best->sequence) {
      best = s;
    }
  }
  if (!best) return {};
  const_cast<Checkpoint*>(this)->sequence_ = best->sequence;
  return {best->payload, best->payload + best->size};
}

bool Checkpoint::save(std::span<const std::byte> payload) noexcept {
  if (payload.size() > capacity_) return false;
  ++sequence_;
  Slot* s = slot(static_cast<int>(sequence_ % 2));
  s->magic = 0;  // not whole while it is being written: a kill in between leaves the other slot
  std::atomic_signal_fence(std::memory_order_seq_cst);
  s->layout = kLayout;
  s->kind = kind_;
  s->sequence = sequence_;
  s->size = static_cast<std::uint32_t>(payload.size());
  std::memcpy(s->payload, payload.data(), payload.size());
  s->checksum = checksum(s->payload, s->size, s->sequence);
  std::atomic_signal_fence(std::memory_order_seq_cst);
  s->magic = kMagic;
  return true;
}

void Checkpoint::sync() noexcept { msync(map_, length_, MS_ASYNC); }

}  // namespace hamel::runtime
