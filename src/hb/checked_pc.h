#pragma once
#include <memory>

#include "solve/preconditioner.h"

namespace fretwave::hb {

/// A preconditioner whose singular blocks are no exceptions: `failure` says what is wrong, and `apply` gives
/// no numbers, so that the linear solver ends as diverged and the step fails on every rank.
class CheckedPreconditioner : public solve::Preconditioner {
 public:
  /// `note`: what else its description says.
  explicit CheckedPreconditioner(std::unique_ptr<solve::Preconditioner> inner, std::string note = "")
      : inner_(std::move(inner)), note_(std::move(note)) {}
  void build(Vec y, Vec row) override;
  void follow(Vec y) override;
  void apply(Vec x, Vec z) override;
  double build_cost() const override { return inner_->build_cost(); }
  std::string describe() const override { return inner_->describe() + note_; }
  std::string failure() const override { return failure_; }

 private:
  std::unique_ptr<solve::Preconditioner> inner_;
  std::string note_, failure_;
};

}  // namespace fretwave::hb
