#include "clients/hamel/gnuplot.h"

#include <unistd.h>

#include <cstdio>

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

std::optional<Problem> draw(const std::string& script, const std::string& path) {
  std::FILE* gnuplot = popen("gnuplot", "w");
  if (!gnuplot) return Problem{"gnuplot", "cannot be started"};
  std::fwrite(script.data(), 1, script.size(), gnuplot);
  const int status = pclose(gnuplot);
  if (status == 0 && access(path.c_str(), R_OK) == 0) return std::nullopt;
  return Problem{path, status == 127 << 8 ? "gnuplot is not installed" : "gnuplot could not draw it"};
}

}  // namespace hamel::client
