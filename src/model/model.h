#pragma once
#include <memory>
#include <string>
#include <vector>

#include "contact/law.h"
#include "petsc.h"

/// Structures: linear terms, contact, linear modes.
namespace fretwave::model {

class StuckBasis;

/// One linear term: sparse A (n_dof x n_dof) on the p-th time derivative, with spatial phase k
/// (python/fretwave/cyclic/sector.py): Z_n = sum s_n^p e^{-i k n theta} A.
struct Term {
  MatHandle A;
  int order = 0;
  int phase = 0;
};

/// What the sector `phase` places ahead adds to the relative displacement: sum over k of B_k e^{-i k n theta}
/// x.
struct PhasedMap {
  MatHandle B;
  int phase = 0;
};

/// Contact pairs of one law. B maps displacements to relative displacements u = B x, rows pair by pair on the
/// rank that owns the pair; pairs that reach into other sectors of a wheel add the maps in `ahead`.
struct Contact {
  std::string name;
  MatHandle B;
  std::shared_ptr<contact::Law> law;
  std::vector<PhasedMap> ahead = {};
  /// Of this rank's pairs in the whole model, where a wheel's follow one another sector by sector.
  std::vector<int> numbers = {};
};

/// M x'' + C x' + K x + B^T f(B x, B x') = 0, distributed over `comm`.
class Model {
 public:
  /// Collective. Terms share one row layout; each contact has its law's pairs as local rows of B. InputError
  /// otherwise.
  Model(std::vector<Term> terms, std::vector<Contact> contacts, double theta = 0, PetscInt unit = 0);
  Model(Model const&) = delete;
  MPI_Comm comm() const { return comm_; }
  PetscInt local_dofs() const { return local_; }
  PetscInt dofs() const { return global_; }
  PetscInt first_dof() const { return first_; }
  /// Angle between the motions of neighbouring sectors at harmonic 1, 2 pi ND / N.
  double theta() const { return theta_; }
  /// Dofs of one sector of a whole wheel, whose sectors follow one another; 0: not a wheel.
  PetscInt unit() const { return unit_; }
  std::vector<Term> const& terms() const { return terms_; }
  std::vector<Contact> const& contacts() const { return contacts_; }
  /// Sum of all terms of one order with no phase; empty handle if there is none.
  MatHandle sum(int order) const;
  /// Nonzero entries of the fullest term. Collective.
  double largest_term() const;
  /// A vector of one entry per dof.
  VecHandle displacement() const;
  /// A phase makes the fundamental's equations complex: a travelling wave, whose mode shapes are complex.
  bool travelling() const;
  /// The modes with all pairs stuck, made when first asked for; null if there are none. Collective.
  StuckBasis const* stuck_basis() const;
  /// The same, of all modes where those that hardly move are left out of it. Collective.
  StuckBasis const* whole_stuck_basis() const;
  /// The lowest of them and a factor for the rest (`StuckBasis::with_factor`), likewise. Collective.
  StuckBasis const* static_basis() const;
  /// Modes of the waves of a wheel, which know their type (`wheel::WaveBases`).
  std::shared_ptr<void>& kept_of_waves() const { return kept_of_waves_; }
  /// All laws are odd: without preload the motion may keep odd harmonics only. Collective.
  bool odd() const;

 private:
  std::vector<Term> terms_;
  std::vector<Contact> contacts_;
  mutable std::shared_ptr<StuckBasis const> stuck_basis_, whole_basis_, static_basis_;
  mutable std::shared_ptr<void> kept_of_waves_;
  mutable bool sought_basis_ = false, sought_whole_ = false, sought_static_ = false;
  MPI_Comm comm_ = MPI_COMM_NULL;
  PetscInt local_ = 0, global_ = 0, first_ = 0, unit_ = 0;
  double theta_ = 0;
};

}  // namespace fretwave::model
