#include "clients/hamel/journal.h"

#include <algorithm>
#include <cerrno>
#include <cinttypes>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "common/base/hash.h"

namespace hamel::client {

namespace {

std::string all_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::uint64_t sum_up(std::uint64_t sum, const std::string& text) { return hashed(text + '\n', sum); }

std::string line_of(const std::string& row, std::uint64_t sum) {
  char hex[32];
  std::snprintf(hex, sizeof hex, "\t%016" PRIx64 "\n", sum);
  return row + hex;
}

std::uint64_t sum_of(const std::string& begin) { return sum_up(kHashStart, begin); }

/// The rows behind `begin` up to the first that does not fit; `lines`: how many there are.
std::vector<std::string> sound_rows(const std::string& text, const std::string& begin, std::size_t& lines) {
  std::vector<std::string> rows;
  std::uint64_t sum = sum_of(begin);
  lines = 0;
  for (std::size_t from = begin.size(), end; (end = text.find('\n', from)) != std::string::npos;
       from = end + 1) {
    const std::string line = text.substr(from, end - from + 1);
    const std::string row = line.substr(0, std::min(line.rfind('\t'), line.size() - 1));
    sum = sum_up(sum, row);
    if (rows.size() == lines++ && line == line_of(row, sum)) rows.push_back(row);
  }
  return rows;
}

}  // namespace

Result<std::unique_ptr<Journal>, Problem> Journal::open(const std::string& path, const std::string& job,
                                                        const std::string& header) {
  std::error_code none;
  if (std::filesystem::exists(path, none) && !std::filesystem::is_regular_file(path, none))
    return Problem{path, "is no ordinary file"};
  std::unique_ptr<Journal> j(new Journal);
  j->path_ = path;
  j->begin_ = "# " + job + "\n" + header + "\n";
  j->sum_ = sum_of(j->begin_);
  const std::string partial = path + ".partial";
  if (const std::string old = all_of(partial); old.starts_with(j->begin_)) {
    std::size_t lines = 0;
    j->kept_ = sound_rows(old, j->begin_, lines);
    j->thrown_away_ = lines - j->kept_.size();
  } else if (old.starts_with("# ")) {
    return Problem{partial, "is of another batch (" + old.substr(2, old.find('\n') - 2) +
                                "): remove it, or write elsewhere"};
  }
  j->file_ = std::fopen(partial.c_str(), "wb");
  bool written = j->file_ && std::fwrite(j->begin_.data(), 1, j->begin_.size(), j->file_) == j->begin_.size();
  for (const std::string& row : j->kept_) written = written && j->write(row);
  if (!written || std::fflush(j->file_) != 0) return Problem{partial, std::strerror(errno)};
  return j;
}

Journal::~Journal() {
  if (file_) std::fclose(file_);
}

bool Journal::write(const std::string& row) {
  sum_ = sum_up(sum_, row);
  ++rows_;
  const std::string line = line_of(row, sum_);
  return std::fwrite(line.data(), 1, line.size(), file_) == line.size();
}

bool Journal::add(const std::string& row) { return write(row) && std::fflush(file_) == 0; }

std::optional<Problem> Journal::finish() {
  const std::string partial = path_ + ".partial", fresh = path_ + ".new";
  const bool closed = std::fclose(file_) == 0;
  file_ = nullptr;
  const std::string text = all_of(partial);
  std::size_t lines = 0;
  const std::vector<std::string> rows =
      text.starts_with(begin_) ? sound_rows(text, begin_, lines) : std::vector<std::string>();
  if (rows.size() != rows_ || lines != rows_) return Problem{partial, "was changed meanwhile"};
  std::ofstream out(fresh, std::ios::binary);
  out << begin_.substr(begin_.find('\n') + 1);
  for (const std::string& row : rows) out << row << '\n';
  out.close();
  std::error_code e;
  if (closed && out) std::filesystem::rename(fresh, path_, e);
  if (!closed || !out || e) return Problem{path_, "cannot be written"};
  std::filesystem::remove(partial, e);
  return {};
}

}  // namespace hamel::client
