#include "model/eigenproblem.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "error.h"
#include "scramble.h"

namespace fretwave::model {

using namespace std::complex_literals;

namespace {

/// A^T D B for D diagonal by contact rows.
MatHandle congruence(Mat A, Vec diagonal, Mat B) {
  MatHandle DB, product;
  check(MatDuplicate(B, MAT_COPY_VALUES, DB.out()));
  check(MatDiagonalScale(DB, diagonal, nullptr));
  check(MatTransposeMatMult(A, DB, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.out()));
  return product;
}

constexpr PetscInt small = 500;

/// Entries of any sign and size, the same on any ranks; `by_rows` over the root of the matrix' diagonal.
VecHandle scrambled_rows(Mat A, int stream, bool by_rows) {
  VecHandle rows;
  PetscInt first;
  double largest;
  check(MatCreateVecs(A, rows.out(), nullptr));
  check(MatGetDiagonal(A, rows));
  check(VecGetOwnershipRange(rows, &first, nullptr));
  check(VecNorm(rows, NORM_INFINITY, &largest));
  WriteArray entries(rows);
  for (PetscInt i = 0; i < local_size(rows); ++i) {
    const auto bits = scrambled(2 * std::uint64_t(first + i) + std::uint64_t(stream));
    const double own = entries[i] != 0 ? std::abs(entries[i]) : largest, stiffness = by_rows ? own : largest;
    entries[i] = (double(bits >> 11) * 0x1p-53 - 0.5) / std::sqrt(stiffness > 0 ? stiffness : 1);
  }
  return rows;
}

/// Of the sector itself.
Mat own_term(std::vector<PhasedMap> const& terms) {
  const auto own = std::ranges::find(terms, 0, &PhasedMap::phase);
  return own != terms.end() ? own->B : terms.front().B;
}

}  // namespace

void add_contact(std::vector<PhasedMap>& sum, Contact const& contact,
                 std::function<double(int, int)> const& entry) {
  VecHandle diagonal;
  check(MatCreateVecs(contact.B, nullptr, diagonal.out()));
  {
    WriteArray d(diagonal);
    const int components = contact.law->components();
    for (int row = 0; row < components * contact.law->pairs(); ++row) {
      const double value = entry(row % components, row / components);
      d[row] = std::isfinite(value) ? value : 0;
    }
  }
  const auto maps = maps_of(contact);
  for (auto const& [A, behind] : maps)
    for (auto const& [B, ahead] : maps) sum.push_back({congruence(A, diagonal, B), ahead - behind});
}

std::vector<PhasedMap> required(Model const& model, int order, char const* name) {
  auto parts = terms_of(model, order);
  if (parts.empty())
    throw InputError(std::string("the model has no ") + name + " term", "none", "one at least",
                     "give all of K and M");
  return parts;
}

bool symmetric(Mat A) {
  MatHandle difference;
  double size, change;
  check(MatTranspose(A, MAT_INITIAL_MATRIX, difference.out()));
  check(MatAXPY(difference, -1, A, UNKNOWN_NONZERO_PATTERN));
  check(MatNorm(A, NORM_INFINITY, &size));
  check(MatNorm(difference, NORM_INFINITY, &change));
  return change <= 1e-12 * size;
}

bool hermitian(std::vector<PhasedMap> const& terms, double theta) {
  for (const bool by_rows : {true, false}) {
    const VecHandle x = scrambled_rows(terms[0].B, 0, by_rows), y = scrambled_rows(terms[0].B, 1, by_rows),
                    product = like(x);
    double size = 0;
    const auto form = [&](Vec a, Mat A, Vec b) {
      double absolute, sum;
      check(MatMult(A, b, product));
      check(VecPointwiseMult(product, a, product));
      check(VecNorm(product, NORM_1, &absolute));
      check(VecSum(product, &sum));
      size += absolute;
      return sum;
    };
    std::complex<double> difference = 0;
    for (auto const& [A, phase] : terms) {
      const auto turn = std::exp(-1i * (phase * theta));
      difference += turn * form(x, A, y) - std::conj(turn) * form(y, A, x);
    }
    if (std::abs(difference) <= (by_rows ? 1e-10 : 1e-12) * size) return true;
  }
  return false;
}

Operators operators(MPI_Comm comm, std::vector<MatHandle> matrices) {
  PetscInt rows, first;
  check(MatGetSize(matrices[0], &rows, nullptr));
  check(MatGetOwnershipRange(matrices[0], &first, nullptr));
  if (comm_size(comm) == 1 || rows > small) return {std::move(matrices), 0};
  Operators out{{}, first};
  for (auto const& A : matrices) {
    out.matrices.emplace_back();
    check(MatCreateRedundantMatrix(A, comm_size(comm), PETSC_COMM_SELF, MAT_INITIAL_MATRIX,
                                   out.matrices.back().out()));
  }
  return out;
}

void take_shape(Model const& model, Operators const& operators, Vec re, Vec im, LinearMode& mode) {
  mode.shape = model.displacement(), mode.imaginary = model.displacement();
  WriteArray shape(mode.shape), imaginary(mode.imaginary);
  const auto place = [&](Vec part, std::complex<double> unit) {
    ReadArray in(part);
    const int width = model.travelling() ? 2 : 1;
    for (PetscInt i = 0; i < model.local_dofs(); ++i)
      for (int k = 0; k < width; ++k) {
        const std::complex<double> value = in[operators.offset + width * i + k] * unit * (k ? 1i : 1.0 + 0i);
        shape[i] += value.real(), imaginary[i] += value.imag();
      }
  };
  place(re, 1.0);
  if (im) place(im, 1i);
}

double trace_ratio(Mat K, Mat M) {
  double k, m;
  const auto trace = [](Mat A, double* sum) {
    VecHandle d;
    check(MatCreateVecs(A, d.out(), nullptr));
    check(MatGetDiagonal(A, d));
    check(VecSum(d, sum));
  };
  trace(K, &k), trace(M, &m);
  return k / m;
}

double scale_of(Mat K, Mat M, std::vector<PhasedMap> const& terms) {
  const double scale = trace_ratio(K, M);
  return scale != 0 ? scale : trace_ratio(own_term(terms), M);
}

void cancel(Mat K, std::vector<PhasedMap> const& terms) {
  constexpr double rounding = 1e-14;
  double size, own;
  check(MatNorm(K, NORM_INFINITY, &size));
  check(MatNorm(own_term(terms), NORM_INFINITY, &own));
  if (size <= rounding * own) check(MatZeroEntries(K));
}

VecHandle balance(Mat K, Mat M) {
  VecHandle k, m, d;
  check(MatCreateVecs(K, k.out(), nullptr));
  m = like(k), d = like(k);
  check(MatGetDiagonal(K, k)), check(MatGetDiagonal(M, m));
  double most = 0;
  const ReadArray stiffness(k), mass(m);
  for (PetscInt i = 0; i < local_size(k); ++i)
    if (mass[i] > 0) most = std::max(most, std::abs(stiffness[i]) / mass[i]);
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(K), &comm));
  MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPI_DOUBLE, MPI_MAX, comm);
  const WriteArray out(d);
  for (PetscInt i = 0; i < local_size(k); ++i) {
    const double size = std::abs(stiffness[i]) + most * std::max(mass[i], 0.0);
    out[i] = size > 0 ? 1 / std::sqrt(size) : 1;
  }
  return d;
}

MatHandle scaled(Mat A, Vec left, Vec right) {
  MatHandle out;
  check(MatDuplicate(A, MAT_COPY_VALUES, out.out()));
  check(MatDiagonalScale(out, left, right));
  if (left) return out;
  VecHandle largest;
  check(MatCreateVecs(out, nullptr, largest.out()));
  check(MatGetRowMaxAbs(out, largest, nullptr));
  check(VecReciprocal(largest));
  check(MatDiagonalScale(out, largest, nullptr));
  return out;
}

VecHandle scaled_back(Vec x, Vec scales, PetscInt offset) {
  VecHandle out = like(x);
  check(VecCopy(x, out));
  const ReadArray scale(scales);
  const WriteArray values(out);
  for (PetscInt i = 0; i < local_size(scales); ++i) values[offset + i] *= scale[i];
  return out;
}

}  // namespace fretwave::model
