#include "model/moving_modes.h"

#include <slepceps.h>

#include <algorithm>

#include "lapack.h"
#include "petsc.h"
#include "scramble.h"

namespace fretwave::model {

namespace {

using EpsHandle = Handle<EPS, EPSDestroy>;

constexpr double tolerance = 1e-8;  // of modes: what they leave is as small beside the stiffness
constexpr int first_count = 64;     // modes that are asked for first
constexpr int largest_share = 8;    // of all columns: one in so many

struct Modes {
  std::vector<double> theta, vectors;
};

/// The `count` largest eigenvalues of a symmetric C, or more.
Modes largest(std::vector<double>& C, int n, int count) {
  MatHandle A;
  EpsHandle eps;
  check(MatCreateDense(PETSC_COMM_SELF, n, n, n, n, C.data(), A.out()));
  check(EPSCreate(PETSC_COMM_SELF, eps.out()));
  check(EPSSetOptionsPrefix(eps, "stuck_"));
  check(EPSSetOperators(eps, A, nullptr));
  check(EPSSetProblemType(eps, EPS_HEP));
  check(EPSSetDimensions(eps, count, PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, tolerance, 1000));
  check(EPSSetWhichEigenpairs(eps, EPS_LARGEST_REAL));
  VecHandle x = scrambled_vector(n);
  Vec start = x;
  check(EPSSetInitialSpace(eps, 1, &start));
  check(EPSSetFromOptions(eps));
  check(EPSSolve(eps));
  PetscInt found;
  check(EPSGetConverged(eps, &found));
  Modes out;
  for (int j = 0; j < int(found); ++j) {
    double theta;
    check(EPSGetEigenpair(eps, j, &theta, nullptr, x, nullptr));
    const ReadArray values(x);
    out.theta.push_back(theta);
    out.vectors.insert(out.vectors.end(), values.data(), values.data() + n);
  }
  return out;
}

/// The largest, down to `least` of the first at least; none if they are too many.
Modes moving(std::vector<double>& C, int n, double least) {
  const int most = n / largest_share;
  for (int count = 0; count < most;) {
    count = std::min(std::max(first_count, 4 * count), most);
    Modes out = largest(C, n, count);
    if (!out.theta.empty() && out.theta.back() <= least * out.theta.front()) return out;
  }
  return {};
}

/// A := U^-T A U^-1, both triangles.
void congruence(std::vector<double>& A, std::vector<double> const& U, int n) {
  const int type = 1;
  int info;
  dsygst_(&type, "U", &n, A.data(), &n, U.data(), &n, &info);
  lapack::mirror("U", n, A.data());
}

/// A := A Q, Q the orthonormal matrix whose first columns are the vectors, but for their signs.
void times_completed(std::vector<double>& A, int n, std::vector<double>& vectors) {
  const int k = int(vectors.size() / n), size = 64 * n;
  std::vector<double> reflections(k), work(size);
  int info;
  dgeqrf_(&n, &k, vectors.data(), &n, reflections.data(), work.data(), &size, &info);
  dormqr_("R", "N", &n, &n, &k, vectors.data(), &n, reflections.data(), A.data(), &n, work.data(), &size,
          &info);
}

}  // namespace

std::optional<MovingModes> moving_modes(std::vector<double> K, std::vector<double> M, int n, double least) {
  int info;
  dpotrf_("U", &n, K.data(), &n, &info);
  if (info) return {};
  congruence(M, K, n);
  Modes found = moving(M, n, least);
  if (found.theta.empty()) return {};
  dtrtri_("U", "N", &n, K.data(), &n, &info);
  for (int j = 0; j < n; ++j) std::fill(&K[size_t(j) * n] + j + 1, &K[size_t(j) * n] + n, 0.0);
  times_completed(K, n, found.vectors);
  return MovingModes{std::move(found.theta), std::move(K)};
}

}  // namespace fretwave::model
