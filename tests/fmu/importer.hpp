// A model-exchange importer with an integrator of its own: classical Runge-Kutta steps of fixed length, sign changes of
// event indicators located by bisection.
#pragma once

#include "loop/located_conditions.hpp"
#include "slave.hpp"

class Importer : public Slave {
 public:
  explicit Importer(const std::string& game = small_game(), bool logging = false)
      : Slave(game, logging, fmi2ModelExchange) {}

  [[nodiscard]] std::size_t states() const { return model().variables.states().size(); }
  [[nodiscard]] std::size_t indicators() const {
    return static_cast<std::size_t>(mixed_order_game::LocatedConditions::located(model().game.parameters));
  }

  /// From instantiated to continuous-time mode.
  void begin(double start = 0.0, std::optional<double> stop = std::nullopt);
  /// From event mode to continuous-time mode.
  fmi2EventInfo finish_event();
  /// In steps of h, from the present time.
  void integrate(double t_end, double h);

  [[nodiscard]] std::vector<double> state();
  [[nodiscard]] std::vector<double> rate();
  [[nodiscard]] std::vector<double> event_indicators();
  void move_to(double t, const std::vector<double>& state);

  double time = 0.0;
  int state_events = 0;
  int step_events = 0;
  int moved = 0;  ///< events that changed the state

 private:
  void take_step(double t, const std::vector<double>& from, double h);
  [[nodiscard]] std::vector<double> rate_at(double t, const std::vector<double>& state);
  void handle_event();
};
