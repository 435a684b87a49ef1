#pragma once
#include <memory>
#include <optional>

#include "hb/harmonic_problem.h"
#include "precondition/coupled_pairs.h"
#include "precondition/modal_blocks.h"
#include "solve/preconditioner.h"

namespace fretwave::precondition {

using namespace hb;

/// For models whose pairs can stick: harmonic blocks with all pairs stuck are diagonal in one real basis,
/// made once for a model (`model::StuckBasis`); pairs that slip or open within a period come in with their
/// mean stiffness (`ModalBlocks`), and with what they couple of different harmonics (`CoupledPairs`). Nothing
/// of the structure's size is inverted, and pairs that stick cost nothing. Every rank has its range of
/// harmonics and the forces and motions of its dofs and pairs.
///
/// A basis that is not whole (finite elements) has a factor beside it. With what it leaves out, D = K_s^-1 -
/// Psi Psi^T, taken as static and real at all harmonics, and B D = 0, the border's columns C and rows R,
///
///     q = Psi eta + D (x - C zeta),  and  eta, zeta of  (Psi^T x, x_zeta - R D x)  with corner S - R D C.
class BasisPreconditioner : public solve::Preconditioner {
 public:
  /// The model's basis of all modes.
  explicit BasisPreconditioner(HarmonicProblem& problem)
      : BasisPreconditioner(problem, *problem.model().stuck_basis()) {}
  BasisPreconditioner(HarmonicProblem&, model::StuckBasis const&);
  void build(Vec y, Vec row) override;
  void follow(Vec y) override;
  void apply(Vec x, Vec z) override;
  double build_cost() const override;
  std::string describe() const override;

 private:
  struct Pair {
    int components, first_row;
  };
  /// A pair that couples harmonics: its first row among those of such pairs, and where its own compliance
  /// begins.
  struct Busy {
    int components, first_row;
    size_t first_block;
  };
  void take(model::StuckBasis const&);
  bool lacks_modes(Exponents const&) const;
  std::vector<std::vector<complex>> structure(Exponents const&) const;
  ModalBorder border(Vec y, Vec row);
  void set_border_vectors(Vec y, Vec row);
  void leave_static(ModalBorder&);
  std::vector<double> in_basis(std::vector<double> const& x, int vectors, double* moved = nullptr) const;
  std::vector<double> forces(Vec x);
  void add_static(std::vector<double> const& scalars, double* q) const;
  std::vector<double> mean_tangents(std::vector<PairTangents> const&) const;
  bool moves(int pair, std::vector<double> const& means, size_t at) const;
  std::vector<std::pair<int, size_t>> beginning(std::vector<double> const& means) const;
  void take_contact();
  void add_contact(std::vector<std::pair<int, size_t>> const& pairs);
  std::pair<std::vector<int>, std::vector<ModalBlocks::Entry>> taken(
      std::vector<std::pair<int, size_t>> const& pairs, int first);
  void couple(std::vector<PairTangents> const&);
  double application_flops() const;
  std::vector<int> correct(std::vector<PairTangents> const&, std::vector<size_t> const& first_block);
  std::vector<float> own(double const* blocks, std::vector<int> const& places, int columns) const;
  void add_coupling(double const* f, double* u) const;

  HarmonicProblem& problem_;
  model::StuckBasis const* basis_;
  int n_, m_, scalars_, rank_, size_, local_, first_, last_;
  std::optional<ModalBlocks> blocks_;
  double small_flops_ = 0;                   ///< of the lower modes' blocks, on the rank that has the most
  std::vector<double> damping_;              ///< diagonal of C in the basis
  std::vector<Pair> pairs_;                  ///< of all ranks
  int first_pair_ = 0;                       ///< of this rank
  std::vector<double> means_;                ///< T of all pairs
  std::vector<int> place_;                   ///< of each row of B among those of `blocks_`, -1 for none
  std::vector<PairCorrection> corrections_;  ///< of this rank's pairs that are not stuck
  std::vector<Busy> busy_pairs_;             ///< of all ranks
  std::vector<int> busy_rows_;               ///< their places among the rows of `blocks_`
  std::vector<Rotation> G_;                  ///< of pairs that are not stuck, each alone
  std::unique_ptr<CoupledPairs> coupled_;    ///< none where none couples harmonics
  /// Of the border, on this rank's dofs, by scalar and part (innermost): columns C, rows R; D C; R Psi.
  std::vector<double> columns_, rows_, static_columns_, modal_rows_;
  std::vector<double> static_motion_;  ///< K_s^-1 x of the application
};

/// The same for finite elements.
class StaticPreconditioner : public BasisPreconditioner {
 public:
  explicit StaticPreconditioner(HarmonicProblem& problem)
      : BasisPreconditioner(problem, *problem.model().static_basis()) {}
};

}  // namespace fretwave::precondition
