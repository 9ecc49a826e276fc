// Reference results for the archive's folder extra/, as the layered standard FMI-LS-REF describes them: the outputs of
// the default experiment at a tight tolerance, for whoever wants to compare an importer's results.
#pragma once

#include <map>
#include <string>

#include "model.hpp"

namespace mixed_order_game {

inline constexpr const char* reference_folder = "org.fmi-standard.fmi-ls-ref";
inline constexpr Real reference_tolerance = 1e-10;
inline constexpr Real reference_interval = 0.1;  ///< s

/// Names and contents of the files. None for a game whose run would take long (above all a large one) or fails: its
/// archive goes without.
std::map<std::string, std::string> reference_results(const Model& model);

}  // namespace mixed_order_game
