#include <filesystem>
#include <fstream>
#include <iterator>

#include "common/files/scene_text.h"

namespace hamel::files {

Checked<std::string> read_file(const std::string& path) {
  constexpr std::uintmax_t kMostBytes = 256u << 20;
  std::error_code error;
  if (path.empty()) return Problems{{"(no path)", "names no file"}};
  if (!std::filesystem::exists(path, error)) return Problems{{path, "no such file"}};
  if (!std::filesystem::is_regular_file(path, error)) return Problems{{path, "is not a file"}};
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!error && size > kMostBytes) return Problems{{path, "is larger than 256 MB"}};
  std::ifstream in(path, std::ios::binary);
  if (!in) return Problems{{path, "cannot be opened for reading"}};
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (in.bad()) return Problems{{path, "cannot be read"}};
  return text;
}

}  // namespace hamel::files
