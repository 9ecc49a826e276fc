#include "resource_location.hpp"

#include <algorithm>
#include <cstdio>
#include <memory>
#ifdef _WIN32
#include <filesystem>
#endif

#include "errors.hpp"

namespace mixed_order_game {

namespace {

int hexadecimal(char digit) {
  if (digit >= '0' && digit <= '9') return digit - '0';
  if (digit >= 'a' && digit <= 'f') return digit - 'a' + 10;
  if (digit >= 'A' && digit <= 'F') return digit - 'A' + 10;
  return -1;
}

/// Schemes and hosts of a URI have no case; word is in lower case. Without the C library, which follows the locale.
bool equals_without_case(std::string_view text, std::string_view word) {
  return std::ranges::equal(text, word, [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
}

std::string percent_decoded(std::string_view text) {
  std::string decoded;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const int high = text[k] == '%' && k + 2 < text.size() ? hexadecimal(text[k + 1]) : -1;
    const int low = high >= 0 ? hexadecimal(text[k + 2]) : -1;
    if (low < 0) {
      decoded += text[k];
      continue;
    }
    decoded += static_cast<char>(high * 16 + low);
    k += 2;
  }
  return decoded;
}

#ifdef _WIN32
// fopen takes char for another code than UTF-8 there
std::FILE* open(const std::string& path) {
  return _wfopen(std::filesystem::path(std::u8string(path.begin(), path.end())).c_str(), L"rb");
}
#else
std::FILE* open(const std::string& path) { return std::fopen(path.c_str(), "rb"); }
#endif

}  // namespace

std::string path_of(std::string_view resource_location) {
  constexpr std::string_view scheme = "file:";
  if (resource_location.empty()) throw Error("the resource location is empty, expected a file URI");
  if (!equals_without_case(resource_location.substr(0, scheme.size()), scheme)) {
    if (resource_location.find("://") != std::string_view::npos) {
      throw Error("the resource location is " + std::string(resource_location) + ", expected a file URI");
    }
    return std::string(resource_location);
  }
  std::string_view rest = resource_location.substr(scheme.size());
  if (rest.starts_with("//")) {
    rest.remove_prefix(2);
    const std::size_t slash = rest.find('/');
    const std::string_view host = rest.substr(0, slash);
    if (slash == std::string_view::npos || (!host.empty() && !equals_without_case(host, "localhost"))) {
      throw Error("the resource location is " + std::string(resource_location) + ", expected a folder of this machine");
    }
    rest.remove_prefix(slash);
  }
  std::string path = percent_decoded(rest);
  if (path.empty() || path.find('\0') != std::string::npos) {
    throw Error("the resource location is " + std::string(resource_location) + ", expected an absolute path in it");
  }
#ifdef _WIN32
  if (path.size() > 2 && path[0] == '/' && path[2] == ':') path.erase(0, 1);
#endif
  return path;
}

// C streams: those of C++ would pull functions of the newest C library into the FMU.
std::string content_of(const std::string& path) {
  constexpr std::size_t most = 64 * 1024 * 1024;
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(open(path), std::fclose);
  if (!file) throw Error("cannot open " + path);
  std::string content;
  char block[16384];
  while (const std::size_t count = std::fread(block, 1, sizeof block, file.get())) {
    content.append(block, count);
    if (content.size() > most) throw Error(path + " is larger than 64 MB");
  }
  if (std::ferror(file.get()) != 0) throw Error("cannot read " + path);
  return content;
}

}  // namespace mixed_order_game
