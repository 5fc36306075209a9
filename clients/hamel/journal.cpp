#include "clients/hamel/journal.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace hamel::client {

namespace {

std::string all_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace

Result<std::unique_ptr<Journal>, Problem> Journal::open(const std::string& path, const std::string& job,
                                                        const std::string& header) {
  std::error_code none;
  if (std::filesystem::exists(path, none) && !std::filesystem::is_regular_file(path, none))
    return Problem{path, "is no ordinary file"};
  std::unique_ptr<Journal> j(new Journal);
  j->path_ = path;
  j->head_ = "# " + job + "\n";
  const std::string partial = path + ".partial", begin = j->head_ + header + "\n";
  std::string keep = begin;
  if (const std::string old = all_of(partial); old.starts_with(begin)) {
    std::size_t from = begin.size();
    for (std::size_t end; (end = old.find('\n', from)) != std::string::npos; from = end + 1)
      j->kept_.push_back(old.substr(from, end - from));
    keep = old.substr(0, from);
  } else if (old.starts_with("# ")) {
    return Problem{partial, "is of another batch (" + old.substr(2, old.find('\n') - 2) +
                                "): remove it, or write elsewhere"};
  }
  j->file_ = std::fopen(partial.c_str(), "wb");
  const bool written = j->file_ && std::fwrite(keep.data(), 1, keep.size(), j->file_) == keep.size();
  if (!written || std::fflush(j->file_) != 0) return Problem{partial, std::strerror(errno)};
  return j;
}

Journal::~Journal() {
  if (file_) std::fclose(file_);
}

bool Journal::add(const std::string& row) {
  const std::string line = row + "\n";
  return std::fwrite(line.data(), 1, line.size(), file_) == line.size() && std::fflush(file_) == 0;
}

std::optional<Problem> Journal::finish() {
  const std::string partial = path_ + ".partial", fresh = path_ + ".new";
  const bool closed = std::fclose(file_) == 0;
  file_ = nullptr;
  std::ofstream out(fresh, std::ios::binary);
  out << all_of(partial).substr(head_.size());
  out.close();
  std::error_code e;
  if (closed && out) std::filesystem::rename(fresh, path_, e);
  if (!closed || !out || e) return Problem{path_, "cannot be written"};
  std::filesystem::remove(partial, e);
  return {};
}

}  // namespace hamel::client
