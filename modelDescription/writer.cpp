// mixed-order-game-description: makes modelDescription.xml and reference results for a game, or checks a game.
#include <getopt.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>

#include "constants.hpp"
#include "errors.hpp"
#include "game_check.hpp"
#include "judgement.hpp"
#include "model_description.hpp"
#include "reference_results.hpp"
#include "resource_location.hpp"
#include "sensitivity_run.hpp"

using namespace mixed_order_game;

namespace {

constexpr const char* usage =
    "usage: mixed-order-game-description [[--output FILE] [--extra FOLDER] | --check | --judge | --constants | "
    "--sensitivities] GAME.toml\n"
    "\n"
    "Writes modelDescription.xml of a game to standard output.\n"
    "\n"
    "  -o, --output FILE   write to FILE, which is replaced only when all went well\n"
    "  -e, --extra FOLDER  write reference results below FOLDER, unless the run is long or fails\n"
    "  -c, --check         only check the game: what is wrong with it, and where, in JSON on standard output\n"
    "  -j, --judge         write what is known of its Nash equilibrium, as JSON, to standard output\n"
    "  -k, --constants     write the constants of the theorems over a box, as JSON, to standard output; standard "
    "input\n"
    "                      has the request, in TOML: box = [[LOWER, UPPER], ...] and settings = { \"NAME\" = VALUE }\n"
    "  -s, --sensitivities  write a run and how it changes with parameters, as JSON, to standard output; standard "
    "input\n"
    "                      has the request, in TOML: times = [T0, ...], parameters = [\"NAME\", ...], tolerance = R\n"
    "                      and settings = { \"NAME\" = VALUE }\n"
    "  -h, --help          show this text\n"
    "\n"
    "Exit code: 0 fine, 1 the game is not valid or a file cannot be read or written, 2 wrong usage.\n";

enum Exit { fine = 0, failure = 1, wrong_usage = 2 };

// Arguments come in the system's own code on Windows; the project's paths are UTF-8.
std::string utf8(const char* argument) {
  const std::u8string text = std::filesystem::path(argument).u8string();
  return {text.begin(), text.end()};
}

void write_whole(const std::string& path, const std::string& text) {
  const std::string unfinished = path + "." + std::to_string(getpid()) + ".tmp";
  {
    std::ofstream file(unfinished, std::ios::binary);
    file << text;
    file.close();
    if (file && std::rename(unfinished.c_str(), path.c_str()) == 0) return;
  }
  std::remove(unfinished.c_str());
  throw Error("cannot write " + path);
}

void write_reference_results(const Model& model, const std::string& extra) {
  const std::filesystem::path folder = std::filesystem::path(extra) / reference_folder;
  for (const auto& [name, content] : reference_results(model)) {
    std::filesystem::create_directories(folder);
    write_whole((folder / name).string(), content);
  }
}

Exit check(const std::string& toml) {
  try {
    const Model model(toml);
    std::cout << checked_game(toml, nullptr);
    return fine;
  } catch (const GameError& error) {
    std::cout << checked_game(toml, &error);
    return failure;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const option options[] = {{"output", required_argument, nullptr, 'o'}, {"extra", required_argument, nullptr, 'e'},
                            {"check", no_argument, nullptr, 'c'},        {"judge", no_argument, nullptr, 'j'},
                            {"constants", no_argument, nullptr, 'k'},    {"sensitivities", no_argument, nullptr, 's'},
                            {"help", no_argument, nullptr, 'h'},         {}};
  std::string output;
  std::string extra;
  bool check_only = false;
  bool judge_only = false;
  bool constants_only = false;
  bool sensitivities_only = false;
  for (int option = 0; (option = getopt_long(argc, argv, "o:e:cjksh", options, nullptr)) != -1;) {
    switch (option) {
      case 'o':
        output = optarg;
        break;
      case 'e':
        extra = optarg;
        break;
      case 'c':
        check_only = true;
        break;
      case 'j':
        judge_only = true;
        break;
      case 'k':
        constants_only = true;
        break;
      case 's':
        sensitivities_only = true;
        break;
      case 'h':
        std::cout << usage;
        return fine;
      default:
        std::cerr << usage;
        return wrong_usage;
    }
  }
  const int ways = int{check_only} + int{judge_only} + int{constants_only} + int{sensitivities_only} +
                   int{!output.empty() || !extra.empty()};
  if (optind + 1 != argc || ways > 1) {
    std::cerr << usage;
    return wrong_usage;
  }
  std::string game = argv[optind];
  try {
    game = utf8(argv[optind]);
    std::string toml;
    try {
      toml = content_of(game);
    } catch (const Error& error) {
      std::cerr << error.what() << '\n';
      return failure;
    }
    if (check_only) return check(toml);
    if (judge_only || constants_only || sensitivities_only) {
      const auto request = [] { return std::string(std::istreambuf_iterator<char>(std::cin), {}); };
      std::cout << (judge_only       ? judgement(toml)
                    : constants_only ? constants(toml, request())
                                     : sensitivity_run(toml, request()))
                << std::flush;
      if (!std::cout) throw Error("cannot write to standard output");
      return fine;
    }
    const Model model(toml);
    const std::string xml = model_description(model);
    if (!output.empty()) {
      write_whole(output, xml);
    } else {
      std::cout << xml << std::flush;
      if (!std::cout) throw Error("cannot write to standard output");
    }
    if (!extra.empty()) write_reference_results(model, extra);
    return fine;
  } catch (const GameError& error) {
    std::cerr << game << ": " << error.what() << '\n';
  } catch (const std::exception& error) {
    std::cerr << "mixed-order-game-description: " << error.what() << '\n';
  }
  return failure;
}
