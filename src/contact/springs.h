#pragma once
#include "contact/registry.h"

namespace fretwave::contact {

/// A stop: f = k max(0, u - gap), u > 0 closing. A negative gap presses at rest.
class UnilateralSpring : public Law {
 public:
  UnilateralSpring(std::vector<double> stiffness, std::vector<double> gap);
  int components() const override { return 1; }
  int pairs() const override { return int(gap_.size()); }
  bool uses_velocity() const override { return false; }
  int normal() const override { return 0; }
  bool stands_off() const override { return true; }
  double stuck_stiffness(int, int pair) const override { return closed_[pair] ? stiffness_[pair] : 0; }
  /// For what asks for one moment of it: integration in time, linear modes.
  void force(Motion const&, double* f, Record&) const override;
  void diagnose(Motion const&, double const* f, Diagnosis&) const override;
  Integration integration() const override { return Integration::pieces; }
  LinearPair linear_pair(int i) const override {
    return {.normal_stiffness = stiffness_[i], .load = -stiffness_[i] * (gap_[i] + stand_off_)};
  }

 protected:
  void set_rest(double const* u) override;
  void set_stand_off(double distance) override { stand_off_ = distance; }

 private:
  std::vector<double> stiffness_, gap_;
  std::vector<char> closed_;  ///< at rest
  double stand_off_ = 0;
};

/// f = k3 u^3: what Duffing's oscillator has beside its linear spring. k3 < 0 softens.
class CubicSpring : public Law {
 public:
  explicit CubicSpring(std::vector<double> stiffness) : cubic_(std::move(stiffness)), rest_(cubic_.size()) {}
  int components() const override { return 1; }
  int pairs() const override { return int(cubic_.size()); }
  bool uses_velocity() const override { return false; }
  bool odd() const override { return true; }
  double stuck_stiffness(int, int pair) const override {
    return 3 * cubic_[pair] * rest_[pair] * rest_[pair];
  }
  void force(Motion const&, double* f, Record&) const override;
  void diagnose(Motion const&, double const* f, Diagnosis&) const override;

 protected:
  void set_rest(double const* u) override { rest_.assign(u, u + rest_.size()); }

 private:
  std::vector<double> cubic_, rest_;  ///< [force/length^3], u at rest [length]
};

Entry unilateral_spring_entry();
Entry cubic_spring_entry();

}  // namespace fretwave::contact
