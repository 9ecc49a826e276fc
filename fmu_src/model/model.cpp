#include "model.hpp"

#include <bit>

#include "fingerprint.hpp"

namespace mixed_order_game {

namespace {

std::string interface_guid(std::string_view toml, const Game& game, const ModelVariables& variables) {
  constexpr std::uint64_t meaning_of_the_table = 1;  // raised when a variable changes its meaning but not its entry
  Fingerprint fingerprint;
  fingerprint.add_number(meaning_of_the_table);
  fingerprint.add_text(toml);
  for (const Family& family : variables.families()) {
    fingerprint.add_text(family.name);
    fingerprint.add_number(static_cast<std::uint64_t>(family.count));
    for (const auto property :
         {static_cast<int>(family.type), static_cast<int>(family.causality), static_cast<int>(family.variability),
          static_cast<int>(family.initial), static_cast<int>(family.range.kind), family.derivative_of}) {
      fingerprint.add_number(static_cast<std::uint64_t>(property));
    }
  }
  for (const Real start : variables.save(Settings(game))) fingerprint.add_number(std::bit_cast<std::uint64_t>(start));
  return fingerprint.as_guid();
}

}  // namespace

Model::Model(std::string_view toml)
    : game(parse_game(toml)), variables(game), guid(interface_guid(toml, game, variables)) {}

}  // namespace mixed_order_game
