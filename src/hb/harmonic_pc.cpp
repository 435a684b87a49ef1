#include "hb/harmonic_pc.h"

#include <algorithm>

#include "error.h"

extern "C" {
void zgetrf_(int const*, int const*, std::complex<double>*, int const*, int*, int*);
void zgetrs_(char const*, int const*, int const*, std::complex<double> const*, int const*, int const*,
             std::complex<double>*, int const*, int*);
void dgetrf_(int const*, int const*, double*, int const*, int*, int*);
void dgetrs_(char const*, int const*, int const*, double const*, int const*, int const*, double*, int const*,
             int*);
}

namespace fretwave::hb {

namespace {

/// A distributed matrix whole and dense (column-major) on every rank.
std::vector<double> whole(Mat A) {
  MPI_Comm comm;
  PetscInt n, begin, end;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatGetSize(A, &n, nullptr));
  check(MatGetOwnershipRange(A, &begin, &end));
  std::vector<double> dense(size_t(n) * n, 0.0);
  for (PetscInt row = begin; row < end; ++row) {
    PetscInt count;
    PetscInt const* cols;
    PetscScalar const* values;
    check(MatGetRow(A, row, &count, &cols, &values));
    for (PetscInt k = 0; k < count; ++k) dense[size_t(cols[k]) * n + row] = values[k];
    check(MatRestoreRow(A, row, &count, &cols, &values));
  }
  MPI_Allreduce(MPI_IN_PLACE, dense.data(), int(dense.size()), MPI_DOUBLE, MPI_SUM, comm);
  return dense;
}

void need(int info, char const* what) {
  if (info != 0)
    throw InputError(std::string("the preconditioner's ") + what + " is singular",
                     "LAPACK info " + std::to_string(info), "0",
                     "check the model for free motions at this harmonic");
}

}  // namespace

HarmonicPreconditioner::HarmonicPreconditioner(HarmonicProblem& problem)
    : problem_(problem),
      n_(int(problem.model().dofs())),
      m_(problem.harmonics().block_size()),
      scalars_(problem.scalar_count()),
      rank_(comm_rank(problem.comm())),
      size_(comm_size(problem.comm())) {
  for (auto const& term : problem.model().terms()) terms_.push_back(whole(term.A));
}

/// (Z_n + B^T (K_mean + s_n C_mean) B) / k_ref
std::vector<complex> HarmonicPreconditioner::block(int harmonic, Exponents const& e) const {
  std::vector<complex> A(size_t(n_) * n_);
  const double scale = 1 / problem_.stiffness_scale();
  for (size_t j = 0; j < terms_.size(); ++j) {
    const complex c = scale * problem_.stiffness().coefficients(problem_.model().terms()[j], e)[harmonic];
    for (size_t k = 0; k < A.size(); ++k) A[k] += c * terms_[j][k];
  }
  const complex s = e.s[harmonic];
  for (size_t k = 0; k < A.size(); ++k) A[k] += scale * (contact_stiffness_[k] + s * contact_damping_[k]);
  return A;
}

void HarmonicPreconditioner::factorise(int harmonic, Exponents const& e) {
  Factor factor{harmonic, block(harmonic, e), std::vector<int>(n_)};
  int info;
  zgetrf_(&n_, &n_, factor.lu.data(), &n_, factor.pivots.data(), &info);
  need(info, "harmonic block");
  factors_.push_back(std::move(factor));
}

/// Rows (rc, rs, normalisation, closing) over (qc, qs, z): (ar + i ai)(qc - i qs) = rc - i rs.
void HarmonicPreconditioner::factorise_fundamental(Exponents const& e, Vec y, Vec row) {
  Harmonics const& h = problem_.harmonics();
  const int first = h.fundamental(), offset = h.offset(first), size = 2 * n_ + scalars_;
  std::vector<std::vector<double>> columns;
  for (int j = 0; j < scalars_; ++j) columns.push_back(gathered(problem_.scalar_column(y, j)));
  const auto closing = gathered(row);
  if (!mine(first)) return;
  fundamental_.assign(size_t(size) * size, 0.0);
  const auto at = [&](int i, int j) -> double& { return fundamental_[size_t(j) * size + i]; };
  const auto A = block(first, e);
  for (int j = 0; j < n_; ++j)
    for (int i = 0; i < n_; ++i) {
      const complex a = A[size_t(j) * n_ + i];
      at(i, j) = a.real(), at(i, n_ + j) = a.imag(), at(n_ + i, j) = -a.imag(), at(n_ + i, n_ + j) = a.real();
    }
  for (int i = 0; i < n_; ++i)
    for (int part = 0; part < 2; ++part) {
      for (int j = 0; j < scalars_; ++j)
        at(part * n_ + i, 2 * n_ + j) = columns[j][size_t(i) * m_ + offset + part];
      at(size - 1, part * n_ + i) = closing[size_t(i) * m_ + offset + part];
    }
  for (int j = 0; j < scalars_; ++j) at(size - 1, 2 * n_ + j) = closing[size_t(n_) * m_ + j];
  for (int part = 0; part < scalars_ - 1; ++part) at(2 * n_ + part, part * n_ + int(problem_.dof())) = 1;
  fundamental_pivots_.resize(size);
  int info;
  dgetrf_(&size, &size, fundamental_.data(), &size, fundamental_pivots_.data(), &info);
  need(info, "bordered fundamental block");
}

void HarmonicPreconditioner::build(Vec y, Vec row) {
  const Exponents e = problem_.exponents(y);
  problem_.mean_contact(y, contact_stiffness_, contact_damping_);
  factors_.clear();
  factorise_fundamental(e, y, row);
  for (int i = 0; i < problem_.harmonics().count(); ++i)
    if (i != problem_.harmonics().fundamental() && mine(i)) factorise(i, e);
}

void HarmonicPreconditioner::solve(Factor const& factor, double const* x, double* z) {
  const int offset = problem_.harmonics().offset(factor.harmonic), one = 1;
  const bool mean = problem_.harmonics().orders()[factor.harmonic] == 0;
  std::vector<complex> b(n_);
  for (int i = 0; i < n_; ++i)
    b[i] = complex(x[size_t(i) * m_ + offset], mean ? 0 : -x[size_t(i) * m_ + offset + 1]);
  int info;
  zgetrs_("N", &n_, &one, factor.lu.data(), &n_, factor.pivots.data(), b.data(), &n_, &info);
  for (int i = 0; i < n_; ++i) {
    z[size_t(i) * m_ + offset] = b[i].real();
    if (!mean) z[size_t(i) * m_ + offset + 1] = -b[i].imag();
  }
}

void HarmonicPreconditioner::solve_fundamental(double const* x, double* z) {
  const int offset = problem_.harmonics().offset(problem_.harmonics().fundamental()),
            size = 2 * n_ + scalars_, one = 1;
  std::vector<double> b(size);
  for (int i = 0; i < n_; ++i)
    for (int part = 0; part < 2; ++part) b[part * n_ + i] = x[size_t(i) * m_ + offset + part];
  std::copy_n(x + size_t(n_) * m_, scalars_, b.begin() + 2 * n_);
  int info;
  dgetrs_("N", &size, &one, fundamental_.data(), &size, fundamental_pivots_.data(), b.data(), &size, &info);
  for (int i = 0; i < n_; ++i)
    for (int part = 0; part < 2; ++part) z[size_t(i) * m_ + offset + part] = b[part * n_ + i];
  std::copy_n(b.begin() + 2 * n_, scalars_, z + size_t(n_) * m_);
}

void HarmonicPreconditioner::apply(Vec x, Vec z) {
  const auto in = gathered(x);
  std::vector<double> out(in.size(), 0.0);
  for (auto const& factor : factors_) solve(factor, in.data(), out.data());
  if (mine(problem_.harmonics().fundamental())) solve_fundamental(in.data(), out.data());
  if (size_ > 1)
    MPI_Allreduce(MPI_IN_PLACE, out.data(), int(out.size()), MPI_DOUBLE, MPI_SUM, problem_.comm());
  PetscInt begin;
  check(VecGetOwnershipRange(z, &begin, nullptr));
  WriteArray local(z);
  std::copy_n(out.data() + begin, local_size(z), local.data());
}

}  // namespace fretwave::hb
