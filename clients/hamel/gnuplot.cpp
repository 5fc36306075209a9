#include "clients/hamel/gnuplot.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>

namespace hamel::client {

std::optional<Problem> check_picture_name(const std::string& path) {
  if (path.find_first_of("\n\r") != std::string::npos) return Problem{path, "must not hold a line break"};
  if (path.ends_with(".svg") || path.ends_with(".png")) return std::nullopt;
  return Problem{path, "must end in .svg or .png"};
}

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? "''" : c == '\n' ? " " : std::string(1, c);
  return out + "'";
}

std::string terminal(const std::string& path, int width, int height) {
  const bool png = path.ends_with(".png");
  return fmt::format("set terminal {} noenhanced size {},{} {}\nset output {}\n", png ? "pngcairo" : "svg",
                     width, height, png ? "" : "background 'white'", quoted(path));
}

namespace {

/// True when the picture ends as its kind must: gnuplot does not say when the disk was full.
bool is_whole(const std::string& path) {
  const std::string end = path.ends_with(".png") ? "IEND" : "</svg>";
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  std::string tail(static_cast<std::size_t>(std::clamp<std::streamoff>(file.tellg(), 0, 16)), ' ');
  file.seekg(-static_cast<std::streamoff>(tail.size()), std::ios::end);
  file.read(tail.data(), static_cast<std::streamsize>(tail.size()));
  return file && tail.find(end) != std::string::npos;
}

}  // namespace

std::optional<Problem> draw(const std::string& script, const std::string& path) {
  // gnuplot would draw on the terminal instead
  std::FILE* out = std::fopen(path.c_str(), "w");
  if (!out) return Problem{path, std::string("cannot write: ") + std::strerror(errno)};
  std::fclose(out);
  std::FILE* gnuplot = popen("gnuplot", "w");
  if (!gnuplot) return Problem{"gnuplot", "cannot be started"};
  std::fwrite(script.data(), 1, script.size(), gnuplot);
  const int status = pclose(gnuplot);
  if (status == 127 << 8) return Problem{path, "gnuplot is not installed"};
  if (status != 0) return Problem{path, "gnuplot could not draw it"};
  if (!is_whole(path)) return Problem{path, "was not written whole (disk full?)"};
  return std::nullopt;
}

}  // namespace hamel::client
