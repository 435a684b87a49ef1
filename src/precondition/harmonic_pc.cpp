#include "precondition/harmonic_pc.h"

namespace fretwave::precondition {

HarmonicPreconditioner::HarmonicPreconditioner(HarmonicProblem& problem) : PairwisePreconditioner(problem) {
  for (auto const& term : problem.model().terms()) terms_.push_back(whole(term.A));
}

/// Z_n / k_ref
std::vector<complex> HarmonicPreconditioner::structure(int harmonic, Exponents const& e) const {
  std::vector<complex> A(size_t(n_) * n_);
  for (size_t j = 0; j < terms_.size(); ++j) {
    const complex c = problem_.terms().stiffness().coefficients(problem_.model().terms()[j], e)[harmonic] /
                      problem_.stiffness_scale();
    for (size_t k = 0; k < A.size(); ++k) A[k] += c * terms_[j][k];
  }
  return A;
}

std::vector<complex> HarmonicPreconditioner::block(int harmonic, Exponents const& e) const {
  auto A = structure(harmonic, e);
  const bool mean = problem_.harmonics().orders()[harmonic] == 0;
  add_contact(harmonic, [&](PetscInt i, PetscInt j, Rotation const& r) {
    A[size_t(j) * n_ + i] += mean ? r.cc : r.nearest();
  });
  return A;
}

/// Rows (rc, rs, normalisation, closing) over (qc, qs, z).
std::vector<double> HarmonicPreconditioner::bordered_block(Exponents const& e, Vec y, Vec row) const {
  Harmonics const& h = problem_.harmonics();
  const int first = h.fundamental(), offset = h.offset(first), size = 2 * n_ + scalars_;
  std::vector<double> F(size_t(size) * size, 0.0);
  const auto at = [&](int i, int j) -> double& { return F[size_t(j) * size + i]; };
  const auto add = [&](PetscInt i, PetscInt j, Rotation const& r) {
    at(i, j) += r.cc, at(i, n_ + j) += r.cs, at(n_ + i, j) += r.sc, at(n_ + i, n_ + j) += r.ss;
  };
  const auto A = structure(first, e);
  for (int j = 0; j < n_; ++j)
    for (int i = 0; i < n_; ++i) add(i, j, Rotation::of(A[size_t(j) * n_ + i]));
  add_contact(first, add);
  const auto closing = gathered(row);
  for (int j = 0; j < scalars_; ++j) {
    const auto column = gathered(problem_.scalar_column(y, j));
    for (int i = 0; i < n_; ++i)
      for (int part = 0; part < 2; ++part)
        at(part * n_ + i, 2 * n_ + j) = column[size_t(i) * m_ + offset + part];
    at(size - 1, 2 * n_ + j) = closing[size_t(n_) * m_ + j];
  }
  for (int i = 0; i < n_; ++i)
    for (int part = 0; part < 2; ++part)
      at(size - 1, part * n_ + i) = closing[size_t(i) * m_ + offset + part];
  for (int part = 0; part < scalars_ - 1; ++part)
    for (auto const& [dof, weight] : problem_.row()) at(2 * n_ + part, part * n_ + int(dof)) = weight;
  return F;
}

void HarmonicPreconditioner::prepare(Exponents const& e, Vec y, Vec row) {
  bordered_ = bordered_block(e, y, row);
}

std::unique_ptr<HarmonicBlock> HarmonicPreconditioner::inverse(int harmonic, Exponents const& e) const {
  if (harmonic == problem_.harmonics().fundamental())
    return invert_bordered(place(harmonic), bordered_, scalars_);
  return invert(place(harmonic), block(harmonic, e));
}

std::string HarmonicPreconditioner::describe() const {
  return std::to_string(problem_.harmonics().count()) + " dense blocks of " + std::to_string(n_) + " dofs";
}

}  // namespace fretwave::precondition
