#include "common/runtime/checkpoint.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "common/runtime/log.h"

namespace hamel::runtime {

namespace {

constexpr std::uint32_t kMagic = 0x4c4d4148;  // "HAML"
constexpr std::uint32_t kLayout = 4;
constexpr const char* kDurable = ".durable";
constexpr std::chrono::milliseconds kSyncEach{500};

}  // namespace

BootId boot_id() {
  BootId id{};
  std::ifstream("/proc/sys/kernel/random/boot_id").read(id.data(), id.size());
  return id;
}

struct Checkpoint::Slot {
  std::uint32_t magic, layout, kind, size;
  std::uint64_t checksum, sequence;
  BootId boot;
  std::uint32_t unused;
  std::byte payload[8];

  /// Of all that follows `sequence`, with that as its seed.
  std::uint64_t sum() const {
    return XXH3_64bits_withSeed(&boot, sizeof boot + sizeof unused + size, sequence);
  }
};

constexpr std::size_t kHead = 72;  // bytes of a slot before its payload

/// A whole slot, as it was read.
struct Checkpoint::Found {
  const char* which = "";
  std::uint64_t sequence = 0;
  BootId boot{};
  std::vector<std::byte> payload;
};

Checkpoint::Slot* Checkpoint::slot(int i) const noexcept {
  return reinterpret_cast<Slot*>(map_ + static_cast<std::size_t>(i) * (length_ / 2));
}

Problem Checkpoint::failed(const char* what) const {
  return {path_, std::string(what) + ": " + std::strerror(errno)};
}

Result<std::unique_ptr<Checkpoint>, Problem> Checkpoint::open(const std::string& path, std::uint32_t kind,
                                                              std::size_t capacity, const BootId& boot) {
  std::unique_ptr<Checkpoint> c(new Checkpoint);
  c->path_ = path;
  c->fd_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (c->fd_ < 0) return c->failed("cannot open the checkpoint");
  if (flock(c->fd_, LOCK_EX | LOCK_NB) != 0)
    return Problem{path, "is in use by another process: one writer a checkpoint"};
  const std::size_t half = (sizeof(Slot) + capacity + 4095) / 4096 * 4096;
  c->length_ = 2 * half;
  c->capacity_ = capacity;
  c->kind_ = kind;
  c->boot_ = boot;
  struct stat is {};
  if (fstat(c->fd_, &is) != 0) return c->failed("cannot look at the checkpoint");
  if (is.st_size != 0 && is.st_size != static_cast<off_t>(c->length_)) {
    spdlog::warn("{}: of another size ({} bytes, here {}): refused, {}", path, is.st_size, c->length_,
                 c->keep_aside());
    if (ftruncate(c->fd_, 0) != 0) return c->failed("cannot empty the checkpoint");
  }
  if (ftruncate(c->fd_, static_cast<off_t>(c->length_)) != 0) return c->failed("cannot size the checkpoint");
  // A mapped page that the disk cannot back kills the writer later: claim the space now.
  if (const int e = posix_fallocate(c->fd_, 0, static_cast<off_t>(c->length_)); e != 0) {
    errno = e;
    return c->failed("no room for the checkpoint");
  }
  void* m = mmap(nullptr, c->length_, PROT_READ | PROT_WRITE, MAP_SHARED, c->fd_, 0);
  if (m == MAP_FAILED) return c->failed("cannot map the checkpoint");
  c->map_ = static_cast<std::byte*>(m);
  c->durable_ = std::make_unique<DiskCopy>(path + kDurable, half);
  return c;
}

Result<std::unique_ptr<Checkpoint>, Problem> Checkpoint::resume(const std::string& dir,
                                                                const std::string& service, std::uint32_t arm,
                                                                std::uint32_t kind, std::size_t capacity,
                                                                const BootId& boot, const Restore& restore) {
  auto c = open(fmt::format("{}/{}-{}.checkpoint", dir, service, arm), kind, capacity, boot);
  if (c) c.value()->load(restore);
  return c;
}

Checkpoint::~Checkpoint() {
  if (map_) munmap(map_, length_);
  if (fd_ >= 0) ::close(fd_);
}

/// Copies the file, and moves what lies beside it, to the first free PATH.refused-N.  @return what was done
std::string Checkpoint::keep_aside() const {
  namespace fs = std::filesystem;
  int n = 1;
  const auto name = [&] { return fmt::format("{}.refused-{}", path_, n); };
  while (fs::exists(name()) || fs::exists(name() + kDurable)) ++n;
  std::error_code failed, absent;
  fs::copy_file(path_, name(), failed);
  fs::rename(path_ + kDurable, name() + kDurable, absent);
  return failed ? "could not be kept: " + failed.message() : "kept as " + name();
}

/// What is whole, newest first; says what is not.  `strange` where something is of another version.
std::vector<Checkpoint::Found> Checkpoint::look(bool& strange) const {
  std::vector<Found> found;
  const auto add = [&](const Slot& s, std::size_t room, const char* which) {
    if (s.magic == 0 && s.sequence == 0) return;  // never written
    const bool old = s.magic == kMagic && s.layout != kLayout, other = !old && s.kind != kind_;
    if (old)
      spdlog::warn("{}: {} is of another version (layout {}, here {})", path_, which, s.layout, kLayout);
    else if (s.magic != kMagic || s.size > room || (!other && s.checksum != s.sum()))
      spdlog::warn("{}: {} is damaged", path_, which);
    else if (other)
      spdlog::warn("{}: {} is of another service or version ({:#x}, here {:#x})", path_, which, s.kind,
                   kind_);
    else
      found.push_back({which, s.sequence, s.boot, {s.payload, s.payload + s.size}});
    strange |= old || other;
  };
  for (int i = 0; i < 2; ++i) add(*slot(i), capacity_, "a slot");
  std::ifstream file(path_ + kDurable, std::ios::binary);
  std::vector<char> copy((std::istreambuf_iterator<char>(file)), {});
  const std::size_t held = copy.size();
  copy.resize(std::max(held, sizeof(Slot)));
  add(*reinterpret_cast<const Slot*>(copy.data()), std::max(held, kHead) - kHead, "the copy on the disk");
  std::stable_sort(found.begin(), found.end(),
                   [](const Found& a, const Found& b) { return a.sequence > b.sequence; });
  return found;
}

bool Checkpoint::load(const Restore& restore) {
  bool strange = false, taken = false;
  for (const Found& f : look(strange)) {
    const std::string why = restore(f.payload, f.boot != boot_);
    taken = why.empty();
    if (taken) sequence_ = f.sequence;
    if (taken) break;
    spdlog::warn("{}: {} is {}: refused", path_, f.which, why);
    strange = true;
  }
  if (strange) spdlog::warn("{}: {}", path_, keep_aside());
  if (strange && !taken) std::memset(map_, 0, length_);
  return taken;
}

bool Checkpoint::save(std::span<const std::byte> payload) noexcept {
  static_assert(offsetof(Slot, payload) == kHead);
  if (payload.size() > capacity_) return false;
  ++sequence_;
  Slot* s = slot(static_cast<int>(sequence_ % 2));
  s->magic = 0;  // not whole while it is being written: a kill in between leaves the other slot
  std::atomic_signal_fence(std::memory_order_seq_cst);
  s->layout = kLayout;
  s->kind = kind_;
  s->sequence = sequence_;
  s->boot = boot_;
  s->unused = 0;
  s->size = static_cast<std::uint32_t>(payload.size());
  std::memcpy(s->payload, payload.data(), payload.size());
  s->checksum = s->sum();
  std::atomic_signal_fence(std::memory_order_seq_cst);
  s->magic = kMagic;
  return true;
}

void Checkpoint::sync(std::chrono::steady_clock::time_point now) noexcept {
  if (sequence_ == 0 || now - last_sync_ < kSyncEach) return;
  const Slot* s = slot(static_cast<int>(sequence_ % 2));
  if (durable_->write({reinterpret_cast<const std::byte*>(s), kHead + s->size})) last_sync_ = now;
}

}  // namespace hamel::runtime
