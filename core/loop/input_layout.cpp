#include "loop/input_layout.hpp"

#include <set>

namespace mixed_order_game {

InputLayout::InputLayout(const Parameters& parameters)
    : n_(parameters.shape.actions()),
      own_(parameters.shape.own_entries()),
      dimension_(parameters.shape.dimension),
      heard_(parameters.graph.heard_elsewhere()) {
  const Shape& shape = parameters.shape;
  std::set<int> actions;
  std::set<int> velocities;
  for (int p = 0; p < own_; ++p) {
    const int i = shape.player_of_own(p);
    if (shape.has_plant(i)) continue;
    actions.insert(shape.entry_of_own(p));
    if (shape.is_second_order(i)) velocities.insert(shape.entry_of_own(p));
  }
  for (const int entry : parameters.dynamics->actions_used()) {
    if (!shape.has_plant(shape.player_of(entry))) actions.insert(entry);
  }
  for (const int entry : parameters.dynamics->velocities_used()) {
    if (!shape.has_plant(shape.player_of(entry))) velocities.insert(entry);
  }
  actions_.assign(actions.begin(), actions.end());
  velocities_.assign(velocities.begin(), velocities.end());
}

}  // namespace mixed_order_game
