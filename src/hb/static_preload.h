#pragma once
#include "contact/law.h"
#include "model/model.h"
#include "solve/problem.h"

namespace fretwave::hb {

/// Static equilibrium K x + B^T f(B x) = p P over the load factor p: y = (x / x_ref, p). The contact starts untouched, in one step.
class StaticPreload : public solve::Problem {
 public:
  /// P: load per dof at factor 1; `size`: reference displacement, `stiffness`: reference stiffness. Collective.
  StaticPreload(model::Model const&, Vec P, double size, double stiffness);
  MPI_Comm comm() const override { return model_.comm(); }
  PetscInt local_equations() const override { return model_.local_dofs(); }
  void residual(Vec y, Vec r) override;
  void product(Vec y, Vec dy, Vec dr) override;
  void pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) override;
  void values(Vec y, std::span<double> v) override;
  void metric(Vec y, Vec weights) override { (void)y, check(VecSet(weights, 1)); }
  double parameter_value(double entry) const override { return entry; }
  double parameter_entry(double value) const override { return value; }

  VecHandle initial() const;
  VecHandle displacement(Vec y) const;
  /// The laws of the model take the state at y as their rest state; returns (stick, slip, open) pairs over all ranks. Collective.
  std::array<double, 3> settle(Vec y);

 private:
  struct Group {
    model::Contact const* contact;
    VecHandle u, f;
    std::vector<double> motion, force;  ///< components x pairs
    contact::Record record;
  };
  void contact_force(Group&, Vec x);
  contact::Motion motion_of(Group const&) const;
  void evaluate(Vec y);

  model::Model const& model_;
  double size_, stiffness_;
  MatHandle K_;
  VecHandle P_, x_, dx_, force_;
  std::vector<Group> groups_;
};

}  // namespace fretwave::hb
