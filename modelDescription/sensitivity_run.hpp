// A run with its sensitivities, for the Python package.
#pragma once

#include <string>
#include <string_view>

namespace mixed_order_game {

/// As JSON: the actions of a run at times, how they and x* change with parameters, and the work done. The request is
/// TOML: times = [T0, ...] in s, of which the first is the run's beginning, parameters = ["NAME", ...], tolerance = R
/// and settings = { "NAME" = VALUE, ... }, by the names of the FMU's variables. Throws GameError as parse_game() and
/// for a request that the game does not take, Error for a run that cannot begin or end.
std::string sensitivity_run(std::string_view toml, std::string_view request);

}  // namespace mixed_order_game
